# SPDX-License-Identifier: Apache-2.0
"""Error responses of the service."""

from __future__ import annotations

from collections.abc import Mapping

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from doorstate.errors import CloudContentError, ConfigError, DoorstateError
from doorstate.serving.models import ErrorResponse
from doorstate.serving.request import PredictQuery, format_parameter

STATUS_DESCRIPTIONS = {
    400: "The file is damaged, or a parameter is wrong.",
    401: "A bearer token is needed.",
    408: "No part of the file arrived for some seconds.",
    411: "A large file needs a Content-Length.",
    413: "The file is too large, or needs too much memory.",
    415: "The format of the file is missing or unknown.",
    421: "The Host header names another machine.",
    422: "The file was read, but its cloud cannot be used.",
    429: "Too many files of this address failed. Retry-After gives the seconds to wait.",
    500: "The service has a fault; its log says more.",
    503: "Too many files are waiting. Retry-After gives the seconds to wait.",
    504: "The file arrived too slowly, took too long to process, or no worker was free in time.",
}
_ADVICE = {
    404: "not found: POST a file to /predict, or GET /, /health, /metrics, /docs or /openapi.json",
    405: "method not allowed: POST a file to /predict, or GET /, /health, /metrics, /docs or /openapi.json",
}


def add_error_handlers(app: FastAPI) -> None:
    """Respond to every error with an `ErrorResponse`."""

    @app.exception_handler(HTTPException)
    async def http_error(_: Request, error: HTTPException) -> Response:
        message = _ADVICE.get(error.status_code, error.detail)
        return _error_response(error.status_code, message, error.headers)

    @app.exception_handler(RequestValidationError)
    async def invalid_query(_: Request, error: RequestValidationError) -> Response:
        problem = error.errors()[0]
        name = problem["loc"][-1]
        if problem["type"] == "extra_forbidden":
            parameters = ", ".join(PredictQuery.model_fields)
            refusal = ConfigError(f"unknown parameter {name}", expected=f"one of {parameters}")
        else:
            refusal = ConfigError(problem["msg"], field=str(name))
        return _error_response(400, refusal.describe(format_parameter))

    @app.exception_handler(DoorstateError)
    async def unusable_file(_: Request, error: DoorstateError) -> Response:
        status = 422 if isinstance(error, CloudContentError) else 400
        return _error_response(status, error.describe(format_parameter, with_path=False))

    @app.exception_handler(Exception)
    async def internal_error(_: Request, error: Exception) -> Response:
        return _error_response(500, "internal error: see the log of the service")


def _error_response(status: int, message: str, headers: Mapping[str, str] | None = None) -> JSONResponse:
    return JSONResponse(ErrorResponse(error=message).model_dump(), status, headers)
