# SPDX-License-Identifier: Apache-2.0
"""`doorstate info`."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from doorstate.errors import MissingExtraError


def info(as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False) -> None:
    """List networks, packaged weights, rules and versions.

    \b
    Examples:
      doorstate info
      doorstate info --json
    """
    from doorstate.cli.console import print_table
    from doorstate.clouds.samplers import choose_sampler
    from doorstate.networks.packaged import packaged_networks
    from doorstate.rules import create_rule, list_rules
    from doorstate.training.environment import describe_environment

    try:
        from doorstate.networks import create_network, list_networks
    except ImportError as error:
        raise MissingExtraError(f"info needs the package {error.name}") from error

    environment = describe_environment() | {"sampling": choose_sampler(import_torch=True).library}
    networks: list[dict[str, Any]] = [
        {
            "network": name,
            "parameters": sum(p.numel() for p in create_network(name).parameters()),
            "packaged_weights": [
                weights for weights in packaged_networks() if weights.rpartition("-")[2] == name
            ],
        }
        for name in list_networks()
    ]
    if as_json:
        print(json.dumps(environment | {"networks": networks, "rules": list_rules()}))  # noqa: T201
        return
    print_table("", ["", "value"], [[name, str(value)] for name, value in environment.items()])
    print_table(
        "",
        ["network", "parameters", "packaged weights"],
        [
            [n["network"], f"{n['parameters']:,}", ", ".join(n["packaged_weights"]) or "none"]
            for n in networks
        ],
    )
    print_table("", ["rule", "source"], [[name, create_rule(name).source] for name in list_rules()])
