# SPDX-License-Identifier: Apache-2.0
"""Names that options take: shown in the help, not case-sensitive, and with a suggestion for a typing error.

The lists are read only when they are needed, so that `--help` of other commands is quick.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence

from doorstate.errors import MissingExtraError, unknown_name


class Choice:
    """Parser of an option that takes a name, or several names separated by commas.

    Args:
        kind: kind of thing, such as "rule".
        field: parameter of the option.
        names: returns all names.
        offered: returns the names to show and to suggest; all if not given.
        prefix: beginning of names that are not listed, such as `gaussian:`.
    """

    def __init__(
        self,
        kind: str,
        field: str,
        names: Callable[[], Iterable[str]],
        offered: Callable[[], Iterable[str]] | None = None,
        prefix: str | None = None,
    ) -> None:
        self.__name__ = field
        self._kind, self._field, self._names = kind, field, names
        self._offered = offered or names
        self._prefix = prefix

    def __call__(self, text: str) -> str:
        """Return the names as they are spelled in the library.

        Raises:
            ConfigError: there is no such name.
        """
        return ",".join(self._find(name.strip()) for name in text.split(",") if name.strip())

    def __str__(self) -> str:
        """All offered names."""
        try:
            offered = self._offered()
        except MissingExtraError:  # help is printed without the extra, too
            offered = ()
        return ", ".join([*offered, *([f"{self._prefix}..."] if self._prefix else [])])

    def _find(self, text: str) -> str:
        spelled = {_key(name): name for name in self._names()}
        if self._prefix and text.lower().startswith(self._prefix):
            return text.lower()
        if _key(text) not in spelled:
            raise unknown_name(self._kind, text, self._offered(), field=self._field)
        return spelled[_key(text)]


def _key(name: str) -> str:
    return name.lower().replace("-", "_")


def split_names(values: Sequence[str] | None) -> list[str]:
    """Return the names of a repeatable option, each value of which may hold several."""
    return [name for value in values or () for name in value.split(",") if name]


def _packaged() -> Iterable[str]:
    from doorstate.networks.packaged import packaged_networks

    return packaged_networks()


def _offered() -> Iterable[str]:
    from doorstate.networks.answers import offered_networks

    return offered_networks()


def _networks() -> Iterable[str]:
    from doorstate.networks import MULTI_VIEW, NETWORKS

    return [*NETWORKS, *MULTI_VIEW]


def _rules() -> Iterable[str]:
    from doorstate.rules import list_rules

    return list_rules()


def _protocols() -> Iterable[str]:
    from doorstate.dataset.splits import PROTOCOLS

    return PROTOCOLS


def _recipes() -> Iterable[str]:
    from doorstate.training.recipes import RECIPES

    return RECIPES


def _heads() -> Iterable[str]:
    from doorstate.networks.heads import HEADS, POINT_HEADS

    return [*HEADS, *POINT_HEADS]


def _layouts() -> Iterable[str]:
    from doorstate.dataset.layouts import LAYOUTS

    return LAYOUTS


def _presets() -> Iterable[str]:
    from doorstate.simulation.presets import PRESETS

    return PRESETS


def _sensors() -> Iterable[str]:
    from doorstate.simulation.noise.sensors import SENSORS

    return SENSORS


def _raw_kinds() -> Iterable[str]:
    from doorstate.simulation.settings import RAW_KINDS

    return RAW_KINDS


def _inputs() -> Iterable[str]:
    from doorstate.clouds.normalization import NORMALIZATIONS

    return NORMALIZATIONS


def _cameras() -> Iterable[str]:
    from doorstate.cameras.registry import CAMERAS

    return CAMERAS


PACKAGED = Choice("packaged weights", "network", _packaged, _offered)
NETWORK = Choice("network", "network", _networks)
RULE = Choice("rule", "rule", _rules)
PROTOCOL = Choice("protocol", "protocol", _protocols)
RECIPE = Choice("recipe", "recipe", _recipes)
HEAD = Choice("head", "head", _heads)
LAYOUT = Choice("layout", "layout", _layouts)
PRESET = Choice("preset", "preset", _presets)
SENSOR = Choice("sensor", "sensor", _sensors, prefix="gaussian:")
RAW_KIND = Choice("kind of raw file", "keep", _raw_kinds)
INPUT = Choice("input", "input", _inputs)
KEPT_CROPS = Choice("choice of crops", "crops", lambda: ("all", "best"))
ENGINE = Choice("engine", "engine", lambda: ("processes", "ray"))
CAMERA = Choice("camera", "camera", _cameras)

_PLACEHOLDERS = {
    "packaged": PACKAGED,
    "networks": NETWORK,
    "rules": RULE,
    "protocols": PROTOCOL,
    "recipes": RECIPE,
    "heads": HEAD,
    "layouts": LAYOUT,
    "presets": PRESET,
    "sensors": SENSOR,
    "raw_kinds": RAW_KIND,
    "inputs": INPUT,
    "kept_crops": KEPT_CROPS,
    "engines": ENGINE,
    "cameras": CAMERA,
}


def fill_in(help_text: str) -> str:
    """Return the help of an option with the names that it takes in place of, for example, `{rules}`."""
    return re.sub(r"\{(\w+)\}", lambda place: str(_PLACEHOLDERS[place[1]]), help_text)
