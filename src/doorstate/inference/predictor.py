# SPDX-License-Identifier: Apache-2.0
"""From a raw cloud to an answer, on the path that training took."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.preparation import (
    MIN_POINTS,
    NUM_POINTS,
    CloudSpec,
    PreparedCloud,
    check_one_cloud,
    is_image,
    prepare_cloud,
)
from doorstate.errors import (
    CloudContentError,
    ConfigError,
    MissingExtraError,
    TooFewPointsError,
    WeightsError,
)
from doorstate.inference.gate import Gate
from doorstate.inference.onnx_backend import OnnxBackend
from doorstate.networks.card import WeightsCard
from doorstate.networks.packaged import packaged_weights
from doorstate.rules.base import Detection
from doorstate.types import DECISION_THRESHOLD, STATES, DoorState, Points

if TYPE_CHECKING:
    from doorstate.networks.base import PointNetwork

DEFAULT_NETWORK = "pointnet2"
DEFAULT_GATE = Gate()
BUDGET_POINTS = (256, 512, 1024, 2048, 4096)  # what a time budget is spent on
_BUDGET_REPEATS = 5  # of each, after one that warms up


class DoorFrame(NamedTuple):
    """Where a door is in the sensor frame: the middle of its opening, and where the wall leads on its left.

    A wall straight ahead has a yaw of 90 degrees.
    """

    x_m: float
    y_m: float
    yaw_deg: float


@dataclass(frozen=True)
class Prediction:
    """What a network or a rule says of one cloud."""

    state: DoorState | None  # None: no answer, for a reason
    probabilities: dict[str, float]  # by state
    points: int  # how many points were looked at
    milliseconds: float  # from raw points to this answer
    reason: str = ""  # why there is no answer
    opening_angle_deg: float | None = None  # where the method tells it, as all that follows
    door_probability: float | None = None  # that there is a door at all
    hinge: Literal["left", "right"] | None = None  # as seen from the camera
    frame: DoorFrame | None = None
    opening_width_m: float | None = None
    passable_width_m: float | None = None  # between leaf and jamb
    detections: tuple[Detection, ...] = field(default=(), compare=False, repr=False)  # by a rule, on the way

    @classmethod
    def abstain(cls, reason: str) -> Prediction:
        """Of a cloud that nobody could be asked about."""
        return cls(None, dict.fromkeys(STATES, 0.0), 0, 0.0, reason)


class Predictor:
    """A network with its weights, and the preparation they were trained with.

    Nothing in it changes after it is made, so any number of threads may call one predictor.

    Args:
        network: classifier, or an exported one, which needs no torch.
        card: of its weights.
        points: how many points to look at.
        thin: sample the points from some rows and columns of an organized cloud, which is several times quicker,
            and not from all as in training (clouds.preparation).
        gate: refuses clouds in which too much is missing, with a reason and no state; None refuses nothing.
        clock: seconds that pass, for `milliseconds` and time budgets.

    Raises:
        ConfigError: fewer than 128 points, or another number than an exported network takes.
    """

    def __init__(
        self,
        network: PointNetwork | OnnxBackend,
        card: WeightsCard,
        points: int = NUM_POINTS,
        *,
        thin: bool = True,
        gate: Gate | None = DEFAULT_GATE,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        if points < MIN_POINTS:
            raise ConfigError(f"{points} points asked for: a network looks at {MIN_POINTS} or more")
        if isinstance(network, OnnxBackend):
            if points != network.card.num_points:
                raise ConfigError(
                    f"{points} points asked for, but the .onnx file takes {network.card.num_points}: export it again"
                )
            self._ask = network.ask
        else:
            from doorstate.inference.torch_backend import TorchBackend

            self._ask = TorchBackend(network, card.temperature).ask
        self.network = network
        self.card = card
        self.points = points
        self.spec = CloudSpec(num_points=points, thin=thin, max_depth_m=card.max_depth_m)
        self.gate = gate
        self.clock = clock

    @classmethod
    def load(
        cls,
        name_or_path: str | Path = DEFAULT_NETWORK,
        points: int | None = None,
        *,
        thin: bool = True,
        gate: Gate | None = DEFAULT_GATE,
        budget_ms: float | None = None,
        threads: int | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> Predictor:
        """Load packaged weights by network name, or any weights file by path.

        Args:
            name_or_path: a name of `packaged_networks()`, a `.safetensors` file, or an `.onnx` file of
                `doorstate export`, which needs no torch.
            points: how many points to look at; None takes as many as the weights ask for.
            thin: as of the class.
            gate: as of the class.
            budget_ms: in place of `points`: the most of `BUDGET_POINTS` that this machine, measured now, takes no more
                time for, from a raw 640 x 480 cloud to an answer; the fewest if all take more, and never more
                than the weights were trained with. An `.onnx` file takes the one number it was exported for.
            threads: that an `.onnx` file takes for one answer, as of `OnnxBackend`; torch's are the process's.
            clock: as of the class.

        Raises:
            WeightsError: no such weights, or they cannot be used.
            ConfigError: both points and a budget, a budget that is no time, fewer than 128 points, or points that an
                `.onnx` file does not take.
            MissingExtraError: what the file needs, torch or onnxruntime, is not installed.
        """
        if budget_ms is not None and (points is not None or not budget_ms > 0):
            raise ConfigError(
                f"a budget of {budget_ms} ms with {points} points: give one of them, above zero"
            )
        network, card = _load(name_or_path, threads)

        def looking_at(count: int) -> Predictor:
            return cls(network, card, count, thin=thin, gate=gate, clock=clock)

        if budget_ms is None:
            return looking_at(card.points if points is None else points)
        exported = isinstance(network, OnnxBackend)
        counts = [] if exported else [count for count in BUDGET_POINTS if count <= card.num_points]
        counts = counts or [card.num_points]
        chosen = looking_at(counts[0])
        for count in counts[1:]:
            larger = looking_at(count)
            if _typical_milliseconds(larger) > budget_ms:
                break
            chosen = larger
        return chosen

    def __str__(self) -> str:
        return f"{self.card.network}, {self.points} points"

    def __call__(self, points: Points) -> Prediction:
        """State of the door in a cloud, or none with the reason: too few points, the gate's, no door, or unsure.

        Args:
            points: (N, 3) or organized (H, W, 3) metres, x forward, y left, z up, NaN where nothing was measured.

        Raises:
            CloudContentError: no cloud, or not in metres (clouds.preparation says when).
        """
        return self.batch([points])[0]

    def batch(self, clouds: Sequence[Points]) -> list[Prediction]:
        """States of the doors in several clouds; those with equally many points go through the network at once.

        Args:
            clouds: each as for a call; they may differ in form and size.

        Returns:
            One prediction for each, in their order; its milliseconds are an equal share of the time for all.

        Raises:
            CloudContentError: one of the clouds is none, or not in metres; or `clouds` is one cloud.
        """
        whole = np.asarray(clouds) if hasattr(clouds, "ndim") else None
        if whole is not None and (whole.ndim == 2 or (whole.ndim == 3 and is_image(whole))):
            raise CloudContentError(f"this is one cloud, {whole.shape}: give several, or call the predictor")
        started = self.clock()
        looks = [self._look(cloud) for cloud in clouds]
        asked = [number for number, (_, refused) in enumerate(looks) if refused is None]
        said: dict[int, _Said] = {}
        for count in sorted({len(looks[number][0]) for number in asked}):
            alike = [number for number in asked if len(looks[number][0]) == count]
            probabilities, columns = self._ask(np.stack([looks[number][0] for number in alike]))
            for place, number in enumerate(alike):
                told = {name: float(values[place]) for name, values in columns.items()}
                said[number] = _Said(probabilities[place], told)
        milliseconds = (self.clock() - started) * 1000 / max(1, len(clouds))
        return [
            self._prediction(said.get(number), len(points), milliseconds, refused)
            for number, (points, refused) in enumerate(looks)
        ]

    def prepare(self, points: Points) -> PreparedCloud:
        """What of a cloud the network looks at.

        Raises:
            CloudContentError: as for a call.
            TooFewPointsError: there are not enough.
        """
        prepared = prepare_cloud(points, self.spec)
        if isinstance(self.network, OnnxBackend) and len(prepared.points) < self.points:
            raise TooFewPointsError(
                f"too few points: {len(prepared.points)} distinct, but the .onnx file takes {self.points}: "
                "export it again with fewer --points"
            )
        return prepared

    def _look(self, cloud: Points) -> tuple[Points, str | None]:
        """Points to ask about, and why nobody may be asked."""
        cloud = check_one_cloud(cloud)
        try:
            points = self.prepare(cloud).points
        except TooFewPointsError as error:
            return np.empty((0, 3), np.float32), str(error)
        return points, None if self.gate is None else self.gate(cloud)

    def _prediction(
        self, said: _Said | None, points: int, milliseconds: float, refused: str | None
    ) -> Prediction:
        if said is None:
            return replace(Prediction.abstain(refused or ""), points=points, milliseconds=milliseconds)
        best, told = int(said.probabilities.argmax()), said.told
        sure, p_door = float(said.probabilities[best]), told.get("p_door")
        reason = ""
        if p_door is not None and p_door < DECISION_THRESHOLD:
            reason = f"there seems to be no door: the probability of one is {p_door:.2f}"
        elif sure < self.card.abstain_below:
            label, least = DoorState(best).label, self.card.abstain_below
            reason = f"unsure: {label} has {sure:.2f}, these weights answer from {least:.2f} on"
        return Prediction(
            None if reason else DoorState(best),
            {state: float(p) for state, p in zip(STATES, said.probabilities, strict=True)},
            points,
            milliseconds,
            reason,
            told.get("opening_angle_deg"),
            p_door,
            _hinge(told),
            _frame(told),
            told.get("opening_width_m"),
            told.get("passable_width_m"),
        )

    def warm_up(self) -> None:
        """Run once on noise, so that the first real cloud is as quick as the others."""
        cloud = np.random.default_rng(0).normal(2.0, 1.0, (self.points, 3)).astype(np.float32)
        self._ask(prepare_cloud(cloud, CloudSpec(num_points=self.points)).points[None])


class _Said(NamedTuple):
    """What a network says of one cloud."""

    probabilities: NDArray[np.float32]  # (3,)
    told: Mapping[str, float]  # by further heads (training.answers)


def _hinge(told: Mapping[str, float]) -> Literal["left", "right"] | None:
    if "p_hinge_left" not in told:
        return None
    return "left" if told["p_hinge_left"] >= DECISION_THRESHOLD else "right"


def _frame(told: Mapping[str, float]) -> DoorFrame | None:
    if "door_x_m" not in told:
        return None
    return DoorFrame(told["door_x_m"], told["door_y_m"], told["door_yaw_deg"])


def _load(name_or_path: str | Path, threads: int | None) -> tuple[PointNetwork | OnnxBackend, WeightsCard]:
    path = Path(name_or_path)
    if path.suffix == ".onnx":
        exported = OnnxBackend(path, threads)
        return exported, exported.card
    if path.suffix != ".safetensors":
        if path.suffix or path.exists():
            raise WeightsError(f"{path}: weights end in .safetensors or .onnx")
        path = packaged_weights(str(name_or_path))
    try:
        from doorstate.networks.weights import load_weights
    except ImportError as error:
        raise MissingExtraError(
            f"{path.name} needs the package {error.name}: install it, or give an .onnx file made by doorstate export"
        ) from error
    return load_weights(path)


def _typical_milliseconds(predictor: Predictor) -> float:
    """Median time for a wall 3 m away and the floor before it, as a camera 1 m above the floor sees them."""
    across, up = np.meshgrid(
        np.linspace(0.58, -0.58, 640), np.linspace(0.43, -0.43, 480)
    )  # tangents, 60 degrees
    depth_m = np.minimum(3.0, 1.0 / np.maximum(-up, 0.1))
    scene = (depth_m[..., None] * np.stack((np.ones_like(up), across, up), axis=-1)).astype(np.float32)
    return median_milliseconds(predictor, [scene], _BUDGET_REPEATS)


def median_milliseconds(predictor: Predictor, clouds: Sequence[Points], repeats: int) -> float:
    """Median time over clouds and repeats, after one call that warms up."""
    predictor(clouds[0])
    return statistics.median(predictor(cloud).milliseconds for _ in range(repeats) for cloud in clouds)
