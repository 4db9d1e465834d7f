# SPDX-License-Identifier: Apache-2.0
"""Groups of options that several commands share: typed once, and handed to a command as one object."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, get_type_hints

Command = Callable[..., None]
# Classes in annotations that are imported only when a command runs, so that `--help` is quick.
_UNIMPORTED = dict.fromkeys(("NamedOptions", "ReadOptions", "Resources"), Any)


def with_shared_options(read: Callable[..., Any], name: str) -> Callable[[Command], Command]:
    """Return a decorator that adds options to a command, which gets what they give as one parameter.

    typer makes the options of a command from its signature.

    Args:
        read: function whose parameters are the options, and which returns the object.
        name: parameter of the command that gets it.
    """
    shared = inspect.signature(read).parameters.values()
    shared_hints = get_type_hints(read, localns=_UNIMPORTED, include_extras=True)

    def decorate(command: Command) -> Command:
        hints = get_type_hints(command, localns=_UNIMPORTED, include_extras=True)
        own = [
            parameter
            for parameter in inspect.signature(command).parameters.values()
            if parameter.name != name
        ]
        parameters = [
            parameter.replace(annotation=annotations[parameter.name], kind=inspect.Parameter.KEYWORD_ONLY)
            for annotations, group in ((hints, own), (shared_hints, shared))
            for parameter in group
        ]

        @wraps(command)
        def run(**values: Any) -> None:
            shared_values = {parameter.name: values.pop(parameter.name) for parameter in shared}
            command(**values, **{name: read(**shared_values)})

        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return run

    return decorate
