# SPDX-License-Identifier: Apache-2.0
"""ASGI application: POST a cloud file, get its prediction as JSON."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Annotated

from fastapi import FastAPI, HTTPException, Query, Request, Response
from fastapi.responses import HTMLResponse, JSONResponse, PlainTextResponse

from doorstate import __version__
from doorstate.serving.access import Access, AccessControl
from doorstate.serving.api_page import render_api_page
from doorstate.serving.body import BODY_HEADERS
from doorstate.serving.clients import client_of_address
from doorstate.serving.errors import STATUS_DESCRIPTIONS, add_error_handlers
from doorstate.serving.lingering_close import LingeringClose
from doorstate.serving.metrics import CONTENT_TYPE, CountRequests, Metrics
from doorstate.serving.models import ErrorResponse, HealthResponse, PredictionResponse
from doorstate.serving.request import PredictQuery
from doorstate.serving.uploads import IncompleteUpload, Uploads, declared_bytes
from doorstate.serving.work_queue import WorkQueue
from doorstate.serving.worker import Job, Reply
from doorstate.types import ABSTAINED

_FILE = {"schema": {"type": "string", "format": "binary"}}
_FORM = {"schema": {"type": "object", "properties": {"file": _FILE["schema"]}, "required": ["file"]}}
_REQUEST_BODY = {
    "required": True,
    "description": "Content of the file, or a form with the file as its only part; also packed by gzip.",
    "content": {
        "application/octet-stream": _FILE,
        "image/png": _FILE,
        "text/csv": _FILE,
        "multipart/form-data": _FORM,
    },
}
_WELCOME = f"""doorstate {__version__}: the state of a door from one depth-camera point cloud.

POST /predict?format=pcd  predict the state; the body of the request is the file
GET  /health              state of the service, and the network or rule it uses
GET  /metrics             numbers for Prometheus
GET  /openapi.json        description of the interface (OpenAPI)
GET  /docs                the same as a page
"""


def create_app(queue: WorkQueue, access: Access | None = None) -> FastAPI:
    """Return the service as an ASGI application; it ends the workers of the queue when it stops.

    Args:
        queue: workers that predict the files.
        access: permissions of clients; None admits all that name this machine or an address.
    """
    method = queue.wait_until_ready()
    uploads, metrics = Uploads(queue.limits, lambda: queue.is_busy), Metrics()
    metrics.waiting.set_function(lambda: queue.waiting)
    metrics.bytes_in_flight.set_function(lambda: uploads.total_bytes)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        queue.close()

    app = FastAPI(
        title="doorstate",
        description="The state of a door from one depth-camera point cloud.",
        version=__version__,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
    )
    app.add_middleware(LingeringClose)
    app.add_middleware(AccessControl, access=access or Access())
    app.add_middleware(CountRequests, metrics=metrics)
    add_error_handlers(app)

    @app.get("/", response_class=PlainTextResponse, include_in_schema=False)
    async def welcome() -> str:
        return _WELCOME

    @app.get("/docs", response_class=HTMLResponse, include_in_schema=False)
    async def docs() -> str:
        return render_api_page(app.openapi())

    @app.get("/metrics", include_in_schema=False)
    async def numbers() -> Response:
        return Response(metrics.text(), media_type=CONTENT_TYPE)

    @app.get("/health", summary="State of the service", response_model_exclude_none=True)
    async def health(response: Response) -> HealthResponse:
        response.status_code = 503 if queue.problem else 200
        return HealthResponse(
            ready=not queue.problem,
            version=__version__,
            network=method.network,
            points=method.points,
            rule=method.rule,
            problem=queue.problem or None,
        )

    @app.post(
        "/predict",
        summary="Predict the state of the door in a file",
        response_model=PredictionResponse,
        response_model_exclude_unset=True,
        responses={
            status: {"description": description, "model": ErrorResponse}
            for status, description in STATUS_DESCRIPTIONS.items()
        },
        openapi_extra={"requestBody": _REQUEST_BODY},
    )
    async def predict(request: Request, query: Annotated[PredictQuery, Query()]) -> Response:
        options, suffix, door_known = query.read_options(), query.suffix(), query.known_door()
        headers = {name: request.headers.get(name, "") for name in BODY_HEADERS}
        declared = declared_bytes(request, queue.limits.max_bytes)
        client = client_of_address(request.client.host if request.client else "")
        limit_s, problem = queue.limits.timeout_s, "the upload was not complete"
        upload = None
        try:
            async with asyncio.timeout(limit_s):
                await queue.wait_for_space(client, declared, suffix)
                upload = await uploads.read(request, client, declared)
                problem = "there was no result"
                upload.content = bytes(upload.content)  # one copy of a large file, not two
                job = Job(upload.content, headers, suffix, options, door_known)
                reply = await queue.run(job, client)
        except IncompleteUpload as error:
            queue.note_failed_upload(client, error.size)
            raise
        except TimeoutError as error:
            if upload is None:
                queue.note_failed_upload(client, 0)
            raise HTTPException(504, f"{problem} after {limit_s:g} s") from error
        finally:
            if upload is not None:
                uploads.release(upload)
        _count(metrics, reply)
        return JSONResponse(reply.body, reply.status)

    return app


def _count(metrics: Metrics, reply: Reply) -> None:
    if reply.status == 200:
        metrics.predictions.labels(reply.body["state"] or ABSTAINED).inc()
