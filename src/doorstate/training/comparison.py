# SPDX-License-Identifier: Apache-2.0
"""One comparison: every network and rule on every fold of one split, all runs of one experiment file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import Field, ValidationError

from doorstate._jobs import Progress, default_workers, no_progress, run_pieces
from doorstate._models import FrozenModel
from doorstate.clouds.preparation import NUM_POINTS
from doorstate.dataset.join import check_thinned_alike
from doorstate.dataset.loader import CloudLoader, check_states
from doorstate.dataset.splits import (
    NUM_FOLDS,
    ONE_FOLD,
    PROTOCOLS,
    UNSEEN,
    Role,
    draw_splits,
    origin,
    read_splits,
    write_splits,
)
from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.errors import ConfigError, RunError, first_validation_error
from doorstate.networks import create_network, list_networks, network_class
from doorstate.networks.head_layers import add_heads
from doorstate.networks.heads import STATE
from doorstate.rules import create_rule
from doorstate.training.fit import RunConfig, fit, threads
from doorstate.training.recipes import Recipe, find_recipe
from doorstate.training.rule_run import RuleRunConfig, answer
from doorstate.training.run_folder import RunFolder, check_same, read_json, run_of, write_json
from doorstate.types import PARTS

M = TypeVar("M", bound=FrozenModel)


class Experiment(FrozenModel):
    """One flat experiment file; the same keys are options of `doorstate compare`."""

    name: str
    dataset: str
    protocol: str = "paper"
    networks: tuple[str, ...] = Field(default_factory=lambda: tuple(list_networks()))
    rules: tuple[str, ...] = ()  # answered beside the networks; nothing is trained
    folds: int = Field(default=NUM_FOLDS, ge=1, le=NUM_FOLDS)  # how many of the five are run
    num_points: int = Field(default=NUM_POINTS, ge=128)
    seed: int = 0
    recipe: str = "common"
    recipe_changes: dict[str, Any] = Field(default_factory=dict)  # fields of the recipe that differ
    network_changes: dict[str, dict[str, Any]] = Field(
        default_factory=dict
    )  # for one network, over recipe_changes
    # A comparison whose weights of the same network and fold the runs go on from; networks it has not begin anew.
    start_from: str | None = None
    heads: tuple[str, ...] = ()  # answers besides the state, trained jointly
    extra_train_datasets: tuple[
        str, ...
    ] = ()  # data sets that are learned whole in every fold, and never tested

    def recipe_of(self, network: str) -> Recipe:
        """The recipe of a network, changes applied.

        Raises:
            ConfigError: no such recipe, or a change that it does not know.
        """
        recipe = find_recipe(self.recipe, network)
        changes = self.recipe_changes | self.network_changes.get(network, {})
        try:
            return Recipe.model_validate(recipe.model_dump() | changes)
        except ValidationError as error:
            problem = first_validation_error(error, Recipe.model_fields)
            raise ConfigError(f"experiment {self.name}: recipe_changes: {problem}") from error

    def heads_of(self, network: str) -> tuple[str, ...]:
        """The heads of a network: all, but "parts" only where it has features of single points."""
        able = network_class(network).has_point_features
        return tuple(name for name in self.heads if able or name != PARTS)

    @property
    def methods(self) -> tuple[str, ...]:
        """Networks and rules."""
        return self.networks + self.rules

    def check(self) -> None:
        """Raise ConfigError for a name that does not exist, before anything is trained."""
        if self.protocol not in PROTOCOLS:
            raise ConfigError(f"no protocol {self.protocol!r}: choose one of {', '.join(PROTOCOLS)}")
        if self.protocol in ONE_FOLD and self.folds != 1:
            raise ConfigError(f"experiment {self.name}: protocol {self.protocol} has one fold: set folds = 1")
        for name in self.network_changes:
            network_class(name)
        for network in self.networks:
            add_heads(create_network(network), self.heads_of(network))
            if self.recipe_of(network).epochs and self.protocol == UNSEEN:
                raise ConfigError(
                    f"experiment {self.name}: protocol {UNSEEN} trains nothing: set recipe_changes.epochs = 0"
                )
            for head in self.recipe_of(network).loss_weights:
                if head not in (STATE, *self.heads):
                    raise ConfigError(
                        f"experiment {self.name}: loss_weights: {network} has no head {head!r}: "
                        f"it learns {', '.join((STATE, *self.heads))}"
                    )
        for rule in self.rules:
            create_rule(rule)


class RunSpec(NamedTuple):
    """One network or rule on one fold, and the folder of its files."""

    method: str
    fold: int
    folder: RunFolder


class _Piece(NamedTuple):
    experiment: Experiment
    folder: Path
    network: str
    fold: int
    threads: int | None


def load_experiment(path: Path | None, overrides: Mapping[str, Any]) -> Experiment:
    """An experiment from a TOML file and overrides; overrides win, then the file, then the defaults.

    Raises:
        ConfigError: the file is missing, is no TOML, or holds an unknown or wrong value.
    """
    values: dict[str, Any] = {}
    if path is not None:
        values = {"name": path.stem} | read_toml(path, "an experiment")
    given = dict(overrides)
    wanted = given.pop("recipe_changes", {})
    try:
        experiment = Experiment.model_validate(values | given)
    except ValidationError as error:
        raise ConfigError(
            f"{path or 'options'}: {first_validation_error(error, Experiment.model_fields)}"
        ) from error
    experiment = experiment.model_copy(
        update={
            "recipe_changes": experiment.recipe_changes | wanted,
            "network_changes": {name: own | wanted for name, own in experiment.network_changes.items()},
        }
    )
    experiment.check()
    return experiment


def read_study(path: Path, model: type[M]) -> M:
    """A study file, which bears the name of its file unless it says another.

    Raises:
        ConfigError: missing, no TOML, or an unknown or wrong value.
    """
    try:
        return model.model_validate({"name": path.stem} | read_toml(path, "a study"))
    except ValidationError as error:
        raise ConfigError(f"{path}: {first_validation_error(error, model.model_fields)}") from error


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Content of a TOML file; ConfigError unless it is one."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read as {what} ({error})") from error


def plan_runs(experiment: Experiment, folder: Path) -> list[RunSpec]:
    """All runs, fold by fold, so that a partial comparison compares all networks on the same folds."""
    return [
        RunSpec(network, fold, run_of(folder, network, fold))
        for fold in range(experiment.folds)
        for network in experiment.methods
    ]


def compare(
    experiment: Experiment, folder: Path, jobs: int = 1, progress: Progress = no_progress
) -> list[dict[str, Any]]:
    """Train and test every network, and ask every rule, on every fold; finished runs are kept, begun ones continued.

    Args:
        experiment: what to run.
        folder: of the comparison: `comparison.json`, `splits.csv`, `runs/<network>/fold<k>/`.
        jobs: runs at the same time; each gets an equal share of the processors.
        progress: called with runs finished and runs in all.

    Returns:
        Metrics of every run.

    Raises:
        RunError: the folder holds another comparison.
    """
    prepare_comparison(experiment, folder)
    runs = plan_runs(experiment, folder)
    share = max(1, default_workers() // jobs) if jobs > 1 else None
    pieces = [_Piece(experiment, folder, run.method, run.fold, share) for run in runs]
    run_pieces(_run_piece, pieces, [run.folder.metrics for run in runs], jobs, progress)
    return [run.folder.read_metrics() for run in runs]


def prepare_comparison(experiment: Experiment, folder: Path) -> None:
    """Write down what is compared and draw the splits, or make sure the folder holds this very comparison."""
    path = folder / "comparison.json"
    settings = experiment.model_dump(mode="json") | {
        "recipe": {"name": experiment.recipe}
        | {network: experiment.recipe_of(network).model_dump(mode="json") for network in experiment.networks}
    }
    if path.is_file():
        check_same(path, settings, "a comparison")
    dataset = open_dataset(Path(experiment.dataset))
    _check_more(experiment, dataset)
    splits_path = folder / "splits.csv"
    if not splits_path.is_file():
        splits = draw_splits(dataset.rows, experiment.protocol, experiment.seed)
        if experiment.networks:
            used = [sample for sample, role in splits[0].items() if role != "unused"]
            check_states(dataset, used, experiment.heads)
        write_splits(splits_path, splits)
    if experiment.start_from is not None:
        before = Path(experiment.start_from)
        earlier = read_comparison(before)
        if not set(experiment.networks) & set(earlier["networks"]):
            raise RunError(f"{before}: has none of {', '.join(experiment.networks)} to go on from")
        if experiment.dataset in earlier.get("extra_train_datasets", ()):
            raise RunError(f"{before}: has learned all of {experiment.dataset}, which is tested here")
        if earlier["dataset"] == experiment.dataset:  # in another, the same name is another sample
            _check_unseen(read_splits(splits_path), before)
    write_json(path, settings)


def _check_more(experiment: Experiment, dataset: PreparedDataset) -> None:
    """Raise ConfigError for data sets to learn besides that show scenes of the one that is tested, or do not fit it."""
    heads = {head for network in experiment.networks for head in experiment.heads_of(network)}
    known = {origin(row) for row in dataset.rows} if experiment.extra_train_datasets else set()
    for path in experiment.extra_train_datasets:
        more = open_dataset(Path(path))
        check_states(more, more.sample_ids, experiment.heads)
        check_thinned_alike(more, dataset)
        # Whatever a later stage of a training would find missing, from one sample.
        CloudLoader(more, more.sample_ids[:1], experiment.num_points, heads=sorted(heads))
        if shared := [row["sample_id"] for row in more.rows if origin(row) in known]:
            raise ConfigError(
                f"extra_train_datasets: {len(shared)} samples of {path} show scenes of {experiment.dataset}, "
                f"such as {shared[0]}: make it with another seed"
            )


def read_comparison(folder: Path) -> dict[str, Any]:
    """What a comparison was asked to run; RunError if there is none."""
    path = folder / "comparison.json"
    if not path.is_file():
        raise RunError(f"{path}: no such comparison; run it first")
    return read_json(path)


def _check_unseen(splits: Sequence[Mapping[str, Role]], start_from: Path) -> None:
    """Raise RunError if weights to go on from have learned what is tested."""
    for fold, (roles, before) in enumerate(zip(splits, read_splits(start_from / "splits.csv"), strict=False)):
        for sample, role in roles.items():
            if role == "test" and before.get(sample) in ("train", "val"):
                raise RunError(
                    f"{start_from}: fold {fold} has learned {sample}, which is tested here; "
                    "use the seed and the protocol of that comparison"
                )


def train_fold(
    experiment: Experiment,
    folder: Path,
    dataset: PreparedDataset,
    network: str,
    fold: int,
    splits_path: Path,
) -> dict[str, Any]:
    """Train one network of an experiment on one fold.

    Args:
        experiment: what is run.
        folder: of this run.
        dataset: the experiment's.
        network: its name.
        fold: from 0.
        splits_path: `splits.csv` of the comparison.

    Returns:
        The run's metrics.

    Raises:
        ConfigError: there is no such fold.
        DatasetError, RunError, WeightsError: as of `fit`.
    """
    splits = read_splits(splits_path)
    if not 0 <= fold < len(splits):
        raise ConfigError(f"there is no fold {fold}: folds are 0 to {len(splits) - 1}")
    recipe = experiment.recipe_of(network)
    extra_train_datasets = experiment.extra_train_datasets if recipe.epochs else ()
    config = RunConfig(
        network=network,
        dataset=experiment.dataset,
        protocol=experiment.protocol,
        fold=fold,
        num_points=experiment.num_points,
        seed=experiment.seed,
        recipe=recipe,
        start_from=_weights_before(experiment, network, fold),
        heads=experiment.heads_of(network),
        extra_train_datasets=extra_train_datasets,
    )
    more = [open_dataset(Path(each)) for each in extra_train_datasets]
    return fit(config, dataset, splits[fold], folder, more)


def _weights_before(experiment: Experiment, network: str, fold: int) -> str | None:
    """The weights file that a run goes on from, if any; RunError without the comparison it should be of."""
    if experiment.start_from is None:
        return None
    before = Path(experiment.start_from)
    if network not in read_comparison(before)["networks"]:
        return None
    return str(run_of(before, network, fold).weights)


def answer_one(
    experiment: Experiment, folder: Path, dataset: PreparedDataset, rule: str, fold: int, splits_path: Path
) -> dict[str, Any]:
    """Ask one rule of an experiment for one fold; arguments and result are those of `train_fold`.

    Raises:
        DatasetError, RunError: as of `rule_run.answer`.
    """
    config = RuleRunConfig(
        rule=rule,
        parameters=create_rule(rule).parameters.model_dump(mode="json"),
        dataset=experiment.dataset,
        protocol=experiment.protocol,
        fold=fold,
    )
    return answer(config, dataset, read_splits(splits_path)[fold], folder)


def _run_piece(piece: _Piece, path: Path) -> None:
    run = answer_one if piece.network in piece.experiment.rules else train_fold
    with threads(piece.threads):
        dataset = open_dataset(Path(piece.experiment.dataset))
        run(piece.experiment, path.parent, dataset, piece.network, piece.fold, piece.folder / "splits.csv")
