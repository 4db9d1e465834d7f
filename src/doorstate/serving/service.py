# SPDX-License-Identifier: Apache-2.0
"""An HTTP API around a predictor: a cloud file in, its answer as JSON out."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import PurePath
from typing import Annotated, Any

from fastapi import FastAPI, HTTPException, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, PlainTextResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException as AnyHTTPException
from starlette.requests import ClientDisconnect

from doorstate import __version__
from doorstate.errors import CloudContentError, DoorstateError
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.inference.serialization import described_file
from doorstate.io.depth import ROLLS_DEG
from doorstate.io.readers import CLOUD_SUFFIXES, UNITS_M, ReadOptions, options_from_flags, parse_cloud
from doorstate.serving.lingering_close import LingeringClose
from doorstate.serving.workload import Limits, Workload
from doorstate.types import STATES

_FORMATS = [suffix.removeprefix(".") for suffix in CLOUD_SUFFIXES]
_FILE = {"schema": {"type": "string", "format": "binary"}}
_MEDIA_TYPES = {"plain": "txt"}  # subtypes that are not named like a file's suffix
_WELCOME = f"""doorstate {__version__}: the state of a door from one depth-camera point cloud.

POST /predict?format=pcd  a file as the body; its answer as JSON
GET  /health              whether files are answered, and by what
GET  /openapi.json        all of this for programs
GET  /docs                the same for people (the page loads its scripts from a public server)
"""
_HINTS = {
    404: "there is nothing here: POST a file to /predict, or GET /, /health or /openapi.json",
    405: "not this way: POST a file to /predict, or GET /, /health or /openapi.json",
}


class FileQuery(BaseModel):
    """What a request says of its file, in the words of `doorstate predict`."""

    model_config = ConfigDict(extra="forbid")

    format: str | None = Field(
        None,
        description="Type of the file; if not given, that of `filename` or of the Content-Type.",
        json_schema_extra={"enum": [*_FORMATS]},
    )
    filename: str | None = Field(None, description="A name whose ending says the type of the file.")
    frame: str = Field(
        "body",
        description="Frame of clouds: body (x forward, y left, z up) or optical (z forward, y down).",
        json_schema_extra={"enum": ["body", "optical"]},
    )
    roll: int = Field(
        0,
        description="How far the camera was turned clockwise, seen from behind, in degrees.",
        json_schema_extra={"enum": list(ROLLS_DEG)},
    )
    units: str = Field(
        "m",
        description="Unit of clouds and of floating point depth images.",
        json_schema_extra={"enum": list(UNITS_M)},
    )
    depth_scale: float = Field(0.001, description="Metres per unit of integer depth images.")
    fx: float | None = Field(None, description="Focal length of depth images in pixels, across.")
    fy: float | None = Field(None, description="Focal length in pixels, down.")
    cx: float | None = Field(None, description="Centre in pixels, across.")
    cy: float | None = Field(None, description="Centre in pixels, down.")


class Answer(BaseModel):
    """What is said of a file: the object that `doorstate predict --json` prints, without the name."""

    state: str | None = Field(
        description="None: no answer, for a reason.", json_schema_extra={"enum": [*STATES, None]}
    )
    probabilities: dict[str, float] = Field(description="By state.")
    points: int = Field(description="How many points were looked at.")
    milliseconds: float = Field(description="From raw points to this answer; reading the file is not in it.")
    reason: str = Field("", description="Why there is no state.")
    opening_angle_deg: float | None = Field(
        None, description="Where the method tells it, as all that follows."
    )
    door_probability: float | None = Field(None, description="That there is a door at all.")
    hinge: str | None = Field(None, description="left or right, as seen from the camera.")
    door_x_m: float | None = Field(None, description="Middle of the opening, ahead of the camera.")
    door_y_m: float | None = Field(None, description="The same, to the left.")
    door_yaw_deg: float | None = Field(
        None, description="Where the wall leads on its left; 90 is straight ahead."
    )
    opening_width_m: float | None = Field(None, description="Of the frame.")
    passable_width_m: float | None = Field(None, description="Between leaf and jamb.")


class Health(BaseModel):
    """By what files are answered."""

    ready: bool
    version: str
    network: str | None = None
    points: int | None = Field(default=None, description="That the network looks at.")
    rule: str | None = Field(default=None, description="In place of a network.")


class Problem(BaseModel):
    """Why a request was not answered."""

    error: str = Field(description="One line.")


_PROBLEMS: dict[int | str, dict[str, Any]] = {
    400: {"description": "The file is damaged, or a parameter is wrong."},
    413: {"description": "The file is too large."},
    415: {"description": "The type of the file is not said, or it cannot be read."},
    422: {"description": "The file was read, but holds nothing a state can be told from."},
    503: {"description": "Too many files are waiting: try again after the seconds in Retry-After."},
    504: {"description": "The file arrived too slowly, or no worker was free in time."},
}


def create_app(predictor: Predictor | RulePredictor, limits: Limits | None = None) -> FastAPI:
    """The service as an ASGI application.

    Args:
        predictor: answers files; it is called from `limits.workers` threads, and torch should use no more of its own
            than the processors left for each.
        limits: what is refused; the defaults of `Limits` if not given.
    """
    workload = Workload(limits or Limits())

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield
        workload.close()

    app = FastAPI(
        title="doorstate",
        description="The state of a door from one depth-camera point cloud.",
        version=__version__,
        lifespan=lifespan,
        redoc_url=None,
    )
    app.add_middleware(LingeringClose)
    _explain_problems(app)

    @app.get("/", response_class=PlainTextResponse, include_in_schema=False)
    async def welcome() -> str:
        return _WELCOME

    @app.get("/health", summary="Whether files are answered, and by what", response_model_exclude_none=True)
    async def health() -> Health:
        if isinstance(predictor, RulePredictor):
            return Health(ready=True, version=__version__, rule=predictor.rule.name)
        return Health(
            ready=True, version=__version__, network=predictor.card.network, points=predictor.points
        )

    @app.post(
        "/predict",
        summary="The state of the door in a file",
        response_model=Answer,
        response_model_exclude_unset=True,
        responses={status: told | {"model": Problem} for status, told in _PROBLEMS.items()},
        openapi_extra={
            "requestBody": {
                "required": True,
                "description": "The file itself, as it is.",
                "content": {"application/octet-stream": _FILE, "image/png": _FILE, "text/csv": _FILE},
            }
        },
    )
    async def predict(request: Request, query: Annotated[FileQuery, Query()]) -> dict[str, Any]:
        options, suffix = _options(query), _suffix(query, request.headers.get("content-type", ""))
        return await workload.answer(
            request, lambda file: described_file(predictor(parse_cloud(file, suffix, options)))
        )

    return app


def _options(query: FileQuery) -> ReadOptions:
    return options_from_flags(
        query.frame,
        query.roll,
        query.units,
        query.depth_scale,
        None,
        (query.fx, query.fy, query.cx, query.cy),
    )


def _suffix(query: FileQuery, content_type: str) -> str:
    """Suffix of the file, by what the request says of it; 415 if that is no type that can be read."""
    if query.format is not None:
        said = query.format.lower().removeprefix(".")
    elif query.filename is not None:
        said = PurePath(query.filename).suffix.lower().removeprefix(".")
    else:
        subtype = content_type.partition(";")[0].rpartition("/")[2].strip().lower().removeprefix("x-")
        said = _MEDIA_TYPES.get(subtype, subtype)
    if said not in _FORMATS:
        raise HTTPException(415, f"unknown type of file: say ?format= and one of {', '.join(_FORMATS)}")
    return f".{said}"


def _explain_problems(app: FastAPI) -> None:
    """Make every error a `Problem`."""

    @app.exception_handler(AnyHTTPException)
    async def refused(_: Request, error: AnyHTTPException) -> Response:
        return _problem(error.status_code, _HINTS.get(error.status_code, error.detail), error.headers)

    @app.exception_handler(RequestValidationError)
    async def wrong_query(_: Request, error: RequestValidationError) -> Response:
        first = error.errors()[0]
        name = first["loc"][-1]
        if first["type"] == "extra_forbidden":
            return _problem(400, f"no parameter {name}: there are {', '.join(FileQuery.model_fields)}")
        return _problem(400, f"{name}: {first['msg']}")

    @app.exception_handler(DoorstateError)
    async def unusable(_: Request, error: DoorstateError) -> Response:
        # The command line's options are parameters here, but files of this machine are none.
        message = re.sub(r"--intrinsics FILE or |--(?=[a-z])", "", str(error))
        return _problem(422 if isinstance(error, CloudContentError) else 400, message)

    @app.exception_handler(ClientDisconnect)
    async def gone(_: Request, error: ClientDisconnect) -> Response:
        return _problem(400, "the client went away")  # nobody hears it

    @app.exception_handler(Exception)
    async def broken(_: Request, error: Exception) -> Response:
        return _problem(500, "this should not happen: the log of the service says what it was")


def _problem(status: int, message: str, headers: Any = None) -> JSONResponse:
    return JSONResponse(Problem(error=message).model_dump(), status, headers)
