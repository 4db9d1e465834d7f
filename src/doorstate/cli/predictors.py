# SPDX-License-Identifier: Apache-2.0
"""Predictors from the options that several commands share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from doorstate.cli.choices import split_names
from doorstate.errors import ConfigError, is_installed

if TYPE_CHECKING:
    from doorstate.evaluation.frame_pieces import PredictorArguments
    from doorstate.inference.predictor import Predictor


class Methods(NamedTuple):
    """Networks and rules that a user named."""

    networks: Sequence[str] | None = None
    weights: Sequence[Path] | None = None
    rules: Sequence[str] | None = None

    def choices(self) -> dict[str, Path | str | None]:
        """Return weights file, network, or None for a rule, by the name of the method.

        Raises:
            ConfigError: two methods have the same name.
        """
        from doorstate.inference.predictor import DEFAULT_NETWORK

        choices: list[tuple[str, Path | str | None]] = [
            *((name, name) for name in split_names(self.networks)),
            *((_weights_name(path, self.weights or ()), path) for path in self.weights or ()),
            *((name, None) for name in split_names(self.rules)),
        ]
        names = [name for name, _ in choices]
        if duplicates := [name for name in names if names.count(name) > 1]:
            raise ConfigError(f"{duplicates[0]} is given twice")
        return dict(choices) or {DEFAULT_NETWORK: DEFAULT_NETWORK}


def _weights_name(path: Path, others: Sequence[Path]) -> str:
    """Return the name of a file without its suffix; those of runs are all alike, and are named by their paths."""
    return path.stem if sum(path.stem == other.stem for other in others) == 1 else str(path)


def load_predictors(
    methods: Methods,
    points: int | None = None,
    *,
    budget_ms: float | None = None,
    threads: int | None = None,
    for_view: bool = False,
    device: str = "cpu",
) -> dict[str, Predictor]:
    """Load and warm up the networks and rules by name; the default network if none is named.

    Points and time budget are those of the networks; beside networks, rules use all points. The device is that of the
    networks. With `for_view` torch runs packaged networks where it is installed, because only torch shows which points
    decided.

    Raises:
        ConfigError: options exclude each other.
        DoorstateError: see `Predictor.load`.
    """
    from doorstate.cli.progress import working
    from doorstate.inference.backends import needs_torch
    from doorstate.inference.backends.threads import configure_torch
    from doorstate.inference.predictor import Predictor

    choices = methods.choices()
    backends = {
        name: "torch" if isinstance(choice, str) and for_view and is_installed("torch") else None
        for name, choice in choices.items()
    }
    networks = [(choice, backends[name]) for name, choice in choices.items() if choice is not None]
    configure_torch(threads, used=any(needs_torch(*network, device) for network in networks))
    predictors = {}
    for name, choice in choices.items():
        is_plain = choice is None and bool(networks)
        with working(f"Loading {name}"):
            predictor = Predictor.load(
                choice,
                rule=name if choice is None else None,
                num_points=None if is_plain else points,
                budget_ms=None if is_plain else budget_ms,
                threads=threads,
                device=device,
                backend=backends[name],
            )
            predictor.warm_up()
        _warn_about_points(name, predictor, points)
        predictors[name] = predictor
    return predictors


def arguments_of(
    predictors: Mapping[str, Predictor], methods: Methods, threads: int | None, device: str
) -> PredictorArguments:
    """Return how other processes load the same predictors, with the points that they have here."""
    from doorstate.evaluation.frame_pieces import PredictorArguments
    from doorstate.inference.network_predictor import NetworkPredictor

    arguments: dict[str, dict[str, Any]] = {}
    for name, choice in methods.choices().items():
        predictor = predictors[name]
        if isinstance(predictor, NetworkPredictor):
            arguments[name] = {
                "name_or_path": choice if isinstance(choice, str) else Path(str(choice)).absolute(),
                "num_points": predictor.num_points,
                "device": device,
            }
        else:
            arguments[name] = {"rule": name}
    return PredictorArguments(arguments, threads or 1)


def load_predictor(
    methods: Methods,
    points: int | None = None,
    *,
    budget_ms: float | None = None,
    threads: int | None = None,
    for_view: bool = False,
) -> Predictor:
    """Load and warm up one network or rule, for commands that use one.

    Raises:
        ConfigError: several are named, or as for `load_predictors`.
        DoorstateError: see `Predictor.load`.
    """
    name, _ = only_method(methods)
    return load_predictors(methods, points, budget_ms=budget_ms, threads=threads, for_view=for_view)[name]


def only_method(methods: Methods) -> tuple[str, Path | str | None]:
    """Return the name of the one method, and its weights file or network, or None for a rule.

    Raises:
        ConfigError: several are named.
    """
    choices = methods.choices()
    if len(choices) > 1:
        raise ConfigError(f"this command takes one network or rule, not {len(choices)}: {', '.join(choices)}")
    return next(iter(choices.items()))


def _warn_about_points(name: str, predictor: Predictor, points: int | None) -> None:
    """Warn if a network gets more points than it was trained with."""
    from doorstate.cli.console import stderr
    from doorstate.inference.network_predictor import NetworkPredictor

    if points is None or not isinstance(predictor, NetworkPredictor):
        return
    trained = predictor.card.num_points
    if points > trained:
        stderr.print(
            f"{name} was trained with {trained} points: --points {points} may make it worse", style="yellow"
        )
