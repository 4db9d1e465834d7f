# SPDX-License-Identifier: Apache-2.0
"""`doorstate info`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from doorstate.cli.options import AsJson

if TYPE_CHECKING:
    from doorstate.networks.answers import AnswerCount

_MISSING = "-"


def info(as_json: AsJson = False) -> None:
    """List what is installed, the packaged weights, networks and rules.

    Weights are listed with the share of clouds that they answer, and that they answer rightly: clean frames of other
    doors, simulated doors like those they were trained on, and recorded frames. Paste the output into a report of a
    problem.

    \b
    Examples:
      doorstate info
      doorstate info --json
    """
    from doorstate.cli.console import print_json, stdout
    from doorstate.cli.installation import describe_installation, missing_by_extra
    from doorstate.rules import create_rule, list_rules

    installation, extras = describe_installation(), missing_by_extra()
    weights, networks = _weights(), _networks()
    if as_json:
        rules = list_rules()
        print_json(
            {**installation, "extras": extras, "weights": weights, "networks": networks, "rules": rules}
        )
        return
    for line in _describe(installation, extras):
        stdout.print(line)
    _print_weights(weights)
    _print_names("network", [[n["network"], f"{n['parameters']:,} parameters"] for n in networks])
    _print_names("rule", [[name, create_rule(name).source] for name in list_rules()])


def _describe(installation: Mapping[str, Any], extras: Mapping[str, Sequence[str]]) -> list[str]:
    """Return what is installed as lines."""
    versions = [
        f"{name} {installation[name] or 'not installed'}" for name in ("onnxruntime", "torch", "numpy")
    ]
    slow = " (fpsample or torch-quickfps would be quicker)" if installation["sampling"] == "numpy" else ""
    lines = [
        f"doorstate {installation['doorstate']}, Python {installation['python']}, {installation['platform']}",
        f"processors: {installation['processors']} of {installation['processor']}; "
        f"threads of a network: {installation['threads']}",
        f"packages: {', '.join(versions)}",
        f"farthest-point sampling: {installation['sampling']}{slow}",
    ]
    for extra, missing in extras.items():
        lacks = f'lacks {", ".join(missing)}: pip install "doorstate[{extra}]"' if missing else "installed"
        lines.append(f"extra {extra}: {lacks}")
    return [*lines, ""]


def _weights() -> list[dict[str, Any]]:
    """Return the packaged weights with their counts of answers."""
    from doorstate.inference.predictor import DEFAULT_NETWORK
    from doorstate.networks.answers import offered_networks, packaged_answers
    from doorstate.networks.packaged import packaged_networks

    answers = packaged_answers()
    return [
        {
            "weights": name,
            "default": name == DEFAULT_NETWORK,
            "offered": name in offered_networks(),
            **(answers[name].model_dump(exclude_none=True) if name in answers else {}),
        }
        for name in packaged_networks()
    ]


def _networks() -> list[dict[str, Any]]:
    from doorstate.networks.packaged import packaged_networks
    from doorstate.networks.parameters import NUM_PARAMETERS

    return [
        {
            "network": name,
            "parameters": parameters,
            "packaged_weights": [
                weights for weights in packaged_networks() if weights.rpartition("-")[2] == name
            ],
        }
        for name, parameters in NUM_PARAMETERS.items()
    ]


def _print_weights(weights: Sequence[Mapping[str, Any]]) -> None:
    from doorstate.cli.console import print_table
    from doorstate.networks.answers import AnswerCount

    kinds = ("clean", "simulated", "recorded")
    print_table(
        "Packaged weights: clouds of a door that are answered / answered rightly",
        ["weights", *kinds],
        [
            [
                entry["weights"] + _remark(entry),
                *(_share(AnswerCount(**entry[kind])) if kind in entry else _MISSING for kind in kinds),
            ]
            for entry in weights
        ],
    )


def _remark(entry: Mapping[str, Any]) -> str:
    if not entry["offered"]:
        return " (seldom answers)"
    return " (default)" if entry["default"] else ""


def _share(count: AnswerCount) -> str:
    return f"{count.answered / count.frames:.0%} / {count.right / count.frames:.0%}"


def _print_names(title: str, rows: Sequence[Sequence[str]]) -> None:
    """Print names with a text in two columns."""
    from doorstate.cli.console import stdout

    width = max(len(name) for name, _ in rows)
    stdout.print(f"\n{title}s:")
    for name, text in rows:
        stdout.print(f"  {name:<{width}}  {text}")
