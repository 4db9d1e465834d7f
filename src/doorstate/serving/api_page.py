# SPDX-License-Identifier: Apache-2.0
"""HTML page of the interface, from its OpenAPI description; it has no script and loads no other file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from doorstate.pages.render import fill_template


def render_api_page(description: Mapping[str, Any]) -> str:
    """Return the page.

    Args:
        description: OpenAPI description of the service.
    """
    operations = [
        {
            "method": method.upper(),
            "path": path,
            "summary": operation.get("summary", ""),
            "parameters": [_parameter(parameter) for parameter in operation.get("parameters", [])],
            "responses": {code: entry["description"] for code, entry in operation["responses"].items()},
        }
        for path, methods in description["paths"].items()
        for method, operation in methods.items()
    ]
    schemas = {
        name: {field: _field(values) for field, values in schema.get("properties", {}).items()}
        for name, schema in description["components"]["schemas"].items()
    }
    return fill_template(
        "api.html.j2",
        "doorstate.serving",
        info=description["info"],
        operations=operations,
        schemas=schemas,
    )


def _parameter(parameter: Mapping[str, Any]) -> dict[str, str]:
    return {
        "name": parameter["name"],
        **_field(parameter["schema"]),
        "text": parameter.get("description", ""),
    }


def _field(schema: Mapping[str, Any]) -> dict[str, str]:
    """Return type or choices, default and description of a value."""
    choices = schema.get("enum", [])
    kinds = [option.get("type", "") for option in schema.get("anyOf", [schema])]
    default = schema.get("default")
    return {
        "kind": ", ".join(map(str, choices))
        if choices
        else " or ".join(kind for kind in kinds if kind != "null"),
        "default": "" if default is None else str(default),
        "text": schema.get("description", ""),
    }
