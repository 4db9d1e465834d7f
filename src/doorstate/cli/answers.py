# SPDX-License-Identifier: Apache-2.0
"""Commands that answer: of clouds, and of the installation itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.options import DepthScale, Focal, Frame, IntrinsicsFile, Roll, Units, read_options
from doorstate.errors import ConfigError, DoorstateError

if TYPE_CHECKING:
    from doorstate.clouds.io import ReadOptions


def predict(
    files: Annotated[list[Path], typer.Argument(help="Clouds, depth images, or folders of them.")],
    network: Annotated[str, typer.Option(help="Network whose packaged weights to use.")] = "pointnet2",
    weights: Annotated[
        Path | None, typer.Option(help="A weights file of your own, in place of --network.")
    ] = None,
    rule: Annotated[
        str | None, typer.Option(help="Answer by this rule instead of a network: doorstate info lists them.")
    ] = None,
    points: Annotated[
        int | None, typer.Option(help="Points to look at; as trained if not given.", min=128)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False,
    frame: Frame = "body",
    roll: Roll = 0,
    units: Units = "m",
    depth_scale: DepthScale = 0.001,
    intrinsics: IntrinsicsFile = None,
    fx: Focal = None,
    fy: Focal = None,
    cx: Focal = None,
    cy: Focal = None,
) -> None:
    """Tell the state of the door in each file: .pcd .ply .npy .npz .xyz .csv, or depth .png with its camera.

    \b
    Examples:
      doorstate predict cloud.pcd
      doorstate predict --frame optical --json recordings/
      doorstate predict --rule plane_state cloud.pcd
      doorstate predict depth.png --fx 385.9 --fy 385.4 --cx 317.8 --cy 243.7
      doorstate predict depth.png --intrinsics camera_info.yaml --roll 90
    """
    from doorstate.clouds.io import find_clouds
    from doorstate.console import err, print_table, progress_bar
    from doorstate.deployment.predictor import Predictor
    from doorstate.deployment.rule_predictor import RulePredictor
    from doorstate.training.environment import keep_freed_memory
    from doorstate.types import STATES

    options = read_options(frame, roll, units, depth_scale, intrinsics, (fx, fy, cx, cy))
    found = find_clouds(files)
    keep_freed_memory()
    if rule is not None and (weights is not None or points is not None):
        raise ConfigError("--rule has no weights and looks at all points: leave --weights and --points out")
    predictor = Predictor.load(weights or network, points) if rule is None else RulePredictor.load(rule)
    predictor.warm_up()
    rows: list[list[str]] = []
    failures = 0
    with progress_bar("Predicting") as progress:
        for number, path in enumerate(found):
            answer = _answer(predictor, path, options)
            failures += "error" in answer
            if as_json:
                print(json.dumps(answer, ensure_ascii=False), flush=True)  # noqa: T201
            elif "error" in answer:
                err.print(f"{answer['file']}: {answer['error']}", style="red", markup=False, soft_wrap=True)
            else:
                odds = answer["probabilities"]
                said = answer["state"] or f"none: {answer['reason']}"
                shown = [answer["file"], said, *(f"{odds[state]:.3f}" for state in STATES)]
                rows.append([*shown, str(answer["points"]), f"{answer['milliseconds']:.0f}"])
            progress(number + 1, len(found))
    if rows:
        print_table("", ["file", "state", *STATES, "points", "ms"], rows)
    if failures:
        err.print(f"{failures} of {len(found)} files could not be answered")
        raise typer.Exit(1)


def info(as_json: Annotated[bool, typer.Option("--json", help="As one JSON object.")] = False) -> None:
    """Versions, networks, packaged weights and what this machine offers.

    \b
    Examples:
      doorstate info
      doorstate info --json
    """
    from doorstate.clouds.sampling import HAS_FPSAMPLE
    from doorstate.console import print_table
    from doorstate.deployment.predictor import packaged_networks
    from doorstate.networks import create_network, list_networks
    from doorstate.training.environment import describe_environment

    environment = describe_environment() | {"fpsample": HAS_FPSAMPLE}
    packaged = packaged_networks()
    networks = [
        (name, sum(p.numel() for p in create_network(name).parameters()), name in packaged)
        for name in list_networks()
    ]
    if as_json:
        listed = [{"network": n, "parameters": p, "packaged_weights": w} for n, p, w in networks]
        print(json.dumps(environment | {"networks": listed}))  # noqa: T201
        return
    print_table("", ["", "value"], [[name, str(value)] for name, value in environment.items()])
    rows = [[name, f"{count:,}", "yes" if weights else "no"] for name, count, weights in networks]
    print_table("", ["network", "parameters", "weights in the package"], rows)


def _answer(predictor: Any, path: Path, options: ReadOptions) -> dict[str, Any]:
    from doorstate.clouds.io import read_cloud

    try:
        prediction = predictor(read_cloud(path, options))
    except DoorstateError as error:
        reason = str(error)
        return {"file": str(path), "error": reason.removeprefix(f"{path.name}: ")}
    return {
        "file": str(path),
        "state": None if prediction.state is None else prediction.state.label,
        "probabilities": {state: round(p, 6) for state, p in prediction.probabilities.items()},
        "points": prediction.points,
        "milliseconds": round(prediction.milliseconds, 3),
        **({"reason": prediction.reason} if prediction.state is None else {}),
        **(
            {}
            if prediction.opening_angle_deg is None
            else {"opening_angle_deg": round(prediction.opening_angle_deg, 1)}
        ),
    }
