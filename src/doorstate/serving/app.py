# SPDX-License-Identifier: Apache-2.0
"""ASGI application: POST a cloud file, get its prediction as JSON."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Annotated, Any

from fastapi import FastAPI, Query, Request
from fastapi.responses import PlainTextResponse

from doorstate import __version__
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.inference.serialization import prediction_to_dict, require_points
from doorstate.io.readers import parse_posed_cloud
from doorstate.serving.body import read_body
from doorstate.serving.errors import STATUS_DESCRIPTIONS, add_error_handlers
from doorstate.serving.lingering_close import LingeringClose
from doorstate.serving.models import ErrorResponse, HealthResponse, PredictionResponse
from doorstate.serving.request import PredictQuery, format_parameter
from doorstate.serving.work_queue import Limits, WorkQueue

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
GET  /openapi.json        description of the interface (OpenAPI)
GET  /docs                the same as a page, which loads scripts from a public server
"""


def create_app(predictor: Predictor, limits: Limits | None = None) -> FastAPI:
    """Return the service as an ASGI application.

    Args:
        predictor: predicts the files. It is called from `limits.workers` threads, so torch should use no more threads
            of its own than there are processors left for each.
        limits: limits of the service; None for the defaults.
    """
    limits = limits or Limits()
    queue = WorkQueue(limits)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        queue.close()

    app = FastAPI(
        title="doorstate",
        description="The state of a door from one depth-camera point cloud.",
        version=__version__,
        lifespan=lifespan,
        redoc_url=None,
    )
    app.add_middleware(LingeringClose)
    add_error_handlers(app)

    @app.get("/", response_class=PlainTextResponse, include_in_schema=False)
    async def welcome() -> str:
        return _WELCOME

    @app.get("/health", summary="State of the service", response_model_exclude_none=True)
    async def health() -> HealthResponse:
        if isinstance(predictor, NetworkPredictor):
            return HealthResponse(
                ready=True, version=__version__, network=predictor.name, points=predictor.num_points
            )
        return HealthResponse(ready=True, version=__version__, rule=predictor.name)

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
    async def predict(request: Request, query: Annotated[PredictQuery, Query()]) -> dict[str, Any]:
        options, suffix = query.read_options(), query.suffix()

        def predict_file(content: bytes) -> dict[str, Any]:
            upload = read_body(content, request.headers, limits.max_bytes)
            cloud, pose = parse_posed_cloud(upload.content, suffix or upload.suffix, options)
            prediction = require_points(predictor(cloud))
            return prediction_to_dict(prediction, format_parameter) | {"sensor_pose": pose.to_dict()}

        return await queue.run(request, predict_file)

    return app
