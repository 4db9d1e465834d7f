# SPDX-License-Identifier: Apache-2.0
"""The command `doorstate`: parse, call, print; the only catcher of our own exceptions.

Heavy imports happen inside the commands, so that `--help` answers at once.
Exit codes: 0 all well, 1 something could not be done (said in one line), 2 wrong usage, 130 stopped by the user.
"""

from __future__ import annotations

import json
import logging
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.errors import ConfigError, DoorstateError

if TYPE_CHECKING:
    from doorstate.clouds.io import ReadOptions

app = typer.Typer(
    name="doorstate",
    help="The state of a door (open, semi-open, closed) from one depth-camera point cloud.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

# What a cloud file does not say about itself: the same options for `predict` and `prepare`.
_CAMERA = "Reading clouds"
Frame = Annotated[
    str,
    typer.Option(help="Frame of cloud files: body (x forward, y left, z up) or optical (z forward, y down)."),
]
Roll = Annotated[
    int, typer.Option(help="How far the camera was turned clockwise, seen from behind: 0, 90, 180, 270.")
]
Units = Annotated[str, typer.Option(help="Unit of cloud files: m, dm, cm, mm or km.")]
DepthScale = Annotated[float, typer.Option(help="Metres per unit of depth images.")]
IntrinsicsFile = Annotated[
    Path | None, typer.Option("--intrinsics", help="Camera of depth images: JSON or ROS camera_info YAML.")
]
Focal = Annotated[
    float | None, typer.Option(help="Focal length or centre in pixels, in place of --intrinsics.")
]
Workers = Annotated[int | None, typer.Option(help="Processes; all processors if not given.", min=1)]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", help="A field of the recipe, such as --set batch_size=32; repeatable."),
]
_UNITS_M = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "km": 1000.0}


@app.command()
def simulate(
    out: Annotated[Path, typer.Option(help="Folder to make, or to go on with.")],
    preset: Annotated[str, typer.Option(help="ogurob, ogurob-fixed or ogurob-away.")] = "ogurob",
    poses: Annotated[
        int | None, typer.Option(help="How many of the 1353 robot poses; all if not given.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Everything random is drawn from it.", min=0)] = 0,
    keep: Annotated[
        list[str] | None, typer.Option(help="Raw files to keep: pcd, depth, image; repeatable.")
    ] = None,
    workers: Workers = None,
) -> None:
    """Simulate doors seen by a depth camera: a manifest whose every row rebuilds its cloud.

    \b
    Examples:
      doorstate simulate --out data/ogurob
      doorstate simulate --out data/small --poses 60 --keep pcd --keep image
    """
    from doorstate.console import err, print_table, progress_bar
    from doorstate.console import out as stdout
    from doorstate.dataset.strata import BANDS, REGIONS, distance_band, region
    from doorstate.simulation.generate import find_preset
    from doorstate.simulation.run import RAW_KINDS, SimulationSettings, simulate_dataset

    unknown = [kind for kind in keep or [] if kind not in RAW_KINDS]
    if unknown:
        raise ConfigError(f"--keep {unknown[0]}: choose from {', '.join(RAW_KINDS)}")
    kinds: Any = tuple(kind for kind in RAW_KINDS if kind in (keep or []))
    settings = SimulationSettings(preset=find_preset(preset), seed=seed, poses=poses, raw=kinds)
    with progress_bar("Simulating") as progress:
        rows = simulate_dataset(out, settings, workers, progress)
    counts = [
        (distance_band(float(row["distance_m"])), region(float(row["robot_angle_deg"]))) for row in rows
    ]
    print_table(
        "Clouds by distance (m) and angle region (Table 1; a third of each per state)",
        ["distance", *REGIONS, "all"],
        [
            [
                band,
                *(str(counts.count((band, name))) for name in REGIONS),
                str(sum(c[0] == band for c in counts)),
            ]
            for band in BANDS
        ],
    )
    twins = sum(bool(row["same_image_as"]) for row in rows)
    if twins:
        err.print(
            f"{twins} frames look the same in another state: nobody can tell them apart (same_image_as)"
        )
    stdout.print(f"{len(rows)} samples in {out}; next: doorstate prepare {out} --out {out}-4096")


@app.command()
def prepare(
    source: Annotated[Path, typer.Argument(help="A simulated folder, or class folders of clouds.")],
    out: Annotated[Path, typer.Option(help="Folder to make, or to go on with.")],
    points: Annotated[int, typer.Option(help="Points kept of every cloud.", min=128)] = 4096,
    poses: Annotated[
        Path | None,
        typer.Option(help="CSV of poses for class folders: file,x_m,y_m or file,distance_m,robot_angle_deg."),
    ] = None,
    frame: Frame = "body",
    roll: Roll = 0,
    units: Units = "m",
    depth_scale: DepthScale = 0.001,
    intrinsics: IntrinsicsFile = None,
    fx: Focal = None,
    fy: Focal = None,
    cx: Focal = None,
    cy: Focal = None,
    workers: Workers = None,
) -> None:
    """Clean clouds and bring them into farthest-point order, ready for training.

    \b
    Examples:
      doorstate prepare data/ogurob --out data/ogurob-4096
      doorstate prepare ~/OGUROB_DOORS --poses poses.csv --frame optical --out data/original
    """
    from doorstate.console import err, progress_bar
    from doorstate.console import out as stdout
    from doorstate.dataset.prepare import prepare_dataset

    options = _read_options(frame, roll, units, depth_scale, intrinsics, (fx, fy, cx, cy))
    with progress_bar("Preparing") as progress:
        summary = prepare_dataset(source, out, points, poses, options, workers, progress)
    for row in summary.rejected[:10]:
        err.print(f"left out {row['file'] or row['sample_id']}: {row['reason']}", markup=False)
    if summary.rejected:
        err.print(f"{len(summary.rejected)} clouds left out, all in {out / 'rejected.csv'}")
    stdout.print(f"{len(summary.dataset)} clouds of {points} points in {out}")
    if summary.rejected:
        raise typer.Exit(1)


@app.command()
def train(
    network: Annotated[str, typer.Argument(help="pointnet, pointnet2, dgcnn, pointcnn or point2sequence.")],
    data: Annotated[Path, typer.Option(help="A prepared data set.")],
    out: Annotated[Path, typer.Option(help="Folder of the run; a begun run goes on.")],
    fold: Annotated[int, typer.Option(help="Which of the five folds is tested.", min=0, max=4)] = 0,
    protocol: Annotated[str, typer.Option(help="paper or by-pose.")] = "paper",
    points: Annotated[int, typer.Option(help="Points of every cloud.", min=128)] = 4096,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    recipe: Annotated[str, typer.Option(help="common or authors.")] = "common",
    epochs: Annotated[int | None, typer.Option(help="In place of the recipe's.", min=1)] = None,
    changes: Changes = None,
) -> None:
    """Train one network on one fold: weights, predictions and metrics in one folder.

    \b
    Examples:
      doorstate train pointnet2 --data data/ogurob-4096 --points 1024 --epochs 12 --out runs/first
      doorstate train dgcnn --data data/ogurob-4096 --recipe authors --set batch_size=16 --out runs/dgcnn
    """
    from doorstate.console import live_runs
    from doorstate.console import out as stdout
    from doorstate.dataset.splits import draw_splits, write_splits
    from doorstate.dataset.store import open_dataset
    from doorstate.training.comparison import Run, load_experiment, train_one
    from doorstate.training.run_folder import RunFolder

    overrides = {
        "name": out.name,
        "dataset": str(data),
        "protocol": protocol,
        "networks": (network,),
        "num_points": points,
        "seed": seed,
        "recipe": recipe,
        "recipe_changes": _changes(changes, epochs),
    }
    experiment = load_experiment(None, overrides)
    dataset = open_dataset(data)
    splits = out / "splits.csv"
    if not splits.is_file():
        write_splits(splits, draw_splits(dataset.rows, protocol, seed))
    runs = [Run(network, fold, RunFolder(out))]
    with live_runs(runs, {network: experiment.recipe_of(network).epochs}, 1):
        metrics = train_one(experiment, out, dataset, network, fold, splits)
    stdout.print(
        f"{network}, fold {fold}: test macro-F1 {metrics['test_macro_f1']:.4f}, accuracy {metrics['test_accuracy']:.4f}"
        f" on {metrics['test_samples']} clouds; weights in {out / 'weights.safetensors'}"
    )


@app.command()
def compare(
    experiment: Annotated[
        Path | None, typer.Argument(help="An experiment file; options win over it.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the comparison; runs/NAME if not given.")
    ] = None,
    data: Annotated[Path | None, typer.Option(help="A prepared data set.")] = None,
    protocol: Annotated[str | None, typer.Option(help="paper or by-pose.")] = None,
    networks: Annotated[
        str | None, typer.Option(help="Names, separated by commas; all five if not given.")
    ] = None,
    folds: Annotated[
        int | None, typer.Option(help="How many of the five folds to run.", min=1, max=5)
    ] = None,
    points: Annotated[int | None, typer.Option(help="Points of every cloud.", min=128)] = None,
    seed: Annotated[int | None, typer.Option(min=0)] = None,
    recipe: Annotated[str | None, typer.Option(help="common or authors.")] = None,
    epochs: Annotated[int | None, typer.Option(help="In place of the recipe's.", min=1)] = None,
    changes: Changes = None,
    jobs: Annotated[int, typer.Option(help="Runs at the same time.", min=1)] = 1,
) -> None:
    """Cross-validate networks on one split; stopped at any moment, it goes on where it was.

    \b
    Examples:
      doorstate compare experiments/one-fold.toml
      doorstate compare --data data/ogurob-4096 --protocol by-pose --networks pointnet,dgcnn --out runs/two
    """
    from doorstate.console import live_runs, print_table
    from doorstate.training.comparison import compare as run_comparison
    from doorstate.training.comparison import load_experiment, runs_of

    given: dict[str, Any] = {
        "dataset": None if data is None else str(data),
        "protocol": protocol,
        "networks": None if networks is None else tuple(name.strip() for name in networks.split(",")),
        "folds": folds,
        "num_points": points,
        "seed": seed,
        "recipe": recipe,
    }
    overrides = {key: value for key, value in given.items() if value is not None}
    if experiment is None:
        overrides.setdefault("name", out.name if out else "comparison")
    settings = load_experiment(experiment, overrides | {"recipe_changes": _changes(changes, epochs)})
    folder = out or Path("runs") / settings.name
    runs = runs_of(settings, folder)
    planned = {network: settings.recipe_of(network).epochs for network in settings.networks}
    with live_runs(runs, planned, jobs) as progress:
        metrics = run_comparison(settings, folder, jobs, progress)
    print_table(
        f"{settings.name}: macro-F1 on the test folds (protocol {settings.protocol}, {settings.num_points} points)",
        ["network", *(f"fold {fold}" for fold in range(settings.folds)), "mean"],
        [_score_row(network, metrics) for network in settings.networks],
    )
    from doorstate.console import out as stdout

    stdout.print(f"next: doorstate report {folder}")


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(help="A comparison, or a prepared data set.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write to; FOLDER/report if not given.")] = None,
) -> None:
    """Write tables, figures and one self-contained HTML page; of a data set, Table 1 and Figures 1 and 2.

    \b
    Examples:
      doorstate report runs/one-fold
      doorstate report data/ogurob-4096 --out reports/data
    """
    from doorstate.console import err
    from doorstate.console import out as stdout
    from doorstate.evaluation.report import write_dataset_figures, write_everything

    target = out or folder / "report"
    with err.status("Writing the report"):
        if (folder / "comparison.json").is_file():
            page = write_everything(folder, target)
        else:
            page = write_dataset_figures(folder, target)
    stdout.print(f"report: {page}", soft_wrap=True)


@app.command()
def predict(
    files: Annotated[list[Path], typer.Argument(help="Clouds, depth images, or folders of them.")],
    network: Annotated[str, typer.Option(help="Network whose packaged weights to use.")] = "pointnet2",
    weights: Annotated[
        Path | None, typer.Option(help="A weights file of your own, in place of --network.")
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
      doorstate predict depth.png --fx 385.9 --fy 385.4 --cx 317.8 --cy 243.7
      doorstate predict depth.png --intrinsics camera_info.yaml --roll 90
    """
    from doorstate.clouds.io import find_clouds
    from doorstate.console import err, print_table, progress_bar
    from doorstate.deployment.predictor import Predictor
    from doorstate.types import STATES

    options = _read_options(frame, roll, units, depth_scale, intrinsics, (fx, fy, cx, cy))
    found = find_clouds(files)
    predictor = Predictor.load(weights or network, points)
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
                shown = [answer["file"], answer["state"], *(f"{odds[state]:.3f}" for state in STATES)]
                rows.append([*shown, str(answer["points"]), f"{answer['milliseconds']:.0f}"])
            progress(number + 1, len(found))
    if rows:
        print_table("", ["file", "state", *STATES, "points", "ms"], rows)
    if failures:
        err.print(f"{failures} of {len(found)} files could not be answered")
        raise typer.Exit(1)


@app.command()
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


def main() -> None:
    """Run the command line; our own exceptions become one line on standard error."""
    logging.getLogger("lightning_fabric").setLevel(logging.WARNING)
    try:
        app()
    except DoorstateError as error:
        sys.exit(f"doorstate: {error}")
    except KeyboardInterrupt:
        print("doorstate: stopped; the same command goes on from here", file=sys.stderr)  # noqa: T201
        sys.exit(130)


def _read_options(
    frame: str,
    roll: int,
    units: str,
    depth_scale: float,
    intrinsics_file: Path | None,
    flags: tuple[float | None, float | None, float | None, float | None],
) -> ReadOptions:
    from doorstate.clouds.camera import Intrinsics, Pinhole, read_intrinsics
    from doorstate.clouds.io import ReadOptions

    if units not in _UNITS_M:
        raise ConfigError(f"--units {units}: choose one of {', '.join(_UNITS_M)}")
    intrinsics: Intrinsics | Pinhole | None = None
    if intrinsics_file is not None:
        intrinsics = read_intrinsics(intrinsics_file)
    elif any(value is not None for value in flags):
        fx, fy, cx, cy = flags
        if fx is None or fy is None or cx is None or cy is None:
            raise ConfigError("--fx, --fy, --cx and --cy belong together: give all four")
        intrinsics = Pinhole(fx, fy, cx, cy)
    return ReadOptions(frame, roll, intrinsics, depth_scale, _UNITS_M[units])  # type: ignore[arg-type]


def _answer(predictor: Any, path: Path, options: ReadOptions) -> dict[str, Any]:
    from doorstate.clouds.io import read_cloud

    try:
        prediction = predictor(read_cloud(path, options))
    except DoorstateError as error:
        reason = str(error)
        return {"file": str(path), "error": reason.removeprefix(f"{path}: ")}
    return {
        "file": str(path),
        "state": prediction.state.label,
        "probabilities": {state: round(p, 6) for state, p in prediction.probabilities.items()},
        "points": prediction.points,
        "milliseconds": round(prediction.milliseconds, 3),
    }


def _changes(settings: list[str] | None, epochs: int | None) -> dict[str, Any]:
    changes: dict[str, Any] = {} if epochs is None else {"epochs": epochs}
    for setting in settings or []:
        name, equals, value = setting.partition("=")
        if not equals:
            raise ConfigError(f"--set {setting}: write it as FIELD=VALUE")
        try:
            changes[name.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            changes[name.strip()] = value.strip()
    return changes


def _score_row(network: str, metrics: list[dict[str, Any]]) -> list[str]:
    scores = [run["test_macro_f1"] for run in metrics if run["network"] == network]
    return [network, *(f"{score:.4f}" for score in scores), f"{sum(scores) / len(scores):.4f}"]


if __name__ == "__main__":
    main()
