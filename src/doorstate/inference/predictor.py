# SPDX-License-Identifier: Apache-2.0
"""Interface of everything that predicts the state of a door from a cloud."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

from doorstate._memory import keep_freed_memory
from doorstate.clouds.outliers import CleanCloud, remove_outliers
from doorstate.clouds.preparation import CloudSpec, PreparedCloud, prepare_cloud
from doorstate.clouds.shape import check_batch
from doorstate.errors import ConfigError
from doorstate.inference.abstention import Abstention
from doorstate.inference.gate import DEFAULT_GATE, Gate
from doorstate.inference.known import DoorKnown, Known
from doorstate.inference.prediction import Prediction
from doorstate.types import DoorState, Points

DEFAULT_NETWORK = "pointnet2"


class Predictor(ABC):
    """Network or rule that predicts the state of the door in a cloud.

    Nothing in a predictor changes after it is made: threads may share one.

    Attributes:
        gate: rejects clouds in which too much is missing or floats in mid-air; None rejects nothing.
        removes_outliers: remove outliers first, so that gate, network and rule get the same points.
    """

    gate: Gate | None
    removes_outliers: bool

    @classmethod
    def load(
        cls,
        name_or_path: str | Path | None = None,
        *,
        rule: str | None = None,
        num_points: int | None = None,
        budget_ms: float | None = None,
        gate: Gate | None = DEFAULT_GATE,
        threads: int | None = None,
        backend: str | None = None,
        device: str = "cpu",
    ) -> Predictor:
        """Load packaged weights by name, a weights file by path, or a rule by name.

        Args:
            name_or_path: name of packaged weights (`packaged_networks()`), an `.onnx` file written by `export_onnx`, or
                a `.safetensors` file, which needs torch. None: `DEFAULT_NETWORK`.
            rule: name of a rule (`list_rules()`), in place of a network.
            num_points: points that the network evaluates; None takes the number recorded with the weights.
            budget_ms: in place of `num_points`: evaluate as many points as this machine has time for, measured now
                from a raw 640 x 480 cloud to a prediction, and never more than the weights were trained with.
            gate: rejects clouds in which too much is missing; None rejects nothing.
            threads: processor threads of one call to onnxruntime; None: OMP_NUM_THREADS if it
                is set, else one a processor, at most four. Torch's are a setting of the process.
            backend: "onnxruntime" or "torch"; None: torch for a `.safetensors` file or a CUDA device, else onnxruntime.
            device: "cpu", "cuda" or "cuda:N" of the network; "auto" is a CUDA device if torch finds one. Everything
                else, and every rule, runs on the processor.

        Raises:
            ConfigError: options that exclude each other, or no such rule or device, or an impossible number of points.
            WeightsError: no such weights, or they cannot be used.
            MissingExtraError: torch is needed and not installed.
        """
        # The subclasses import this module.
        if rule is not None:
            from doorstate.inference.rule_predictor import RulePredictor

            if name_or_path is not None:
                raise ConfigError("give a network, a weights file or a rule: one of them", field="rule")
            if num_points is not None or budget_ms is not None:
                raise ConfigError("a rule evaluates all points: leave points and time budget out")
            return RulePredictor.from_name(rule, gate=gate)
        from doorstate.inference.network_predictor import NetworkPredictor

        return NetworkPredictor.from_weights(
            DEFAULT_NETWORK if name_or_path is None else name_or_path,
            num_points=num_points,
            budget_ms=budget_ms,
            gate=gate,
            threads=threads,
            backend=backend,
            device=device,
        )

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the network or rule."""

    def __call__(
        self,
        cloud: Points,
        *,
        door_known: DoorKnown = False,
        is_level: bool = False,
        camera_height_m: float | None = None,
    ) -> Prediction:
        """Predict the state of the door in a cloud, or abstain with a reason.

        Only weights for doorways find several doors, turn tilted clouds level, and use a rough place of a door; whole
        clouds must be level.

        Args:
            cloud: (N, 3) or organized (H, W, 3) metres, x forward, y left, z up, NaN where nothing was measured.
            door_known: True if a door is known to be in view, so that "no door" is no answer, or its rough place.
            is_level: z of the cloud points up; False leaves the tilt to be found.
            camera_height_m: height of the camera above the floor, if it is known.

        Raises:
            CloudContentError: not one cloud, or not in metres.
            ConfigError: a rough place that this method or cloud cannot use.
        """
        return self._predict([cloud], Known(door_known, is_level, camera_height_m))[0]

    def batch(
        self,
        clouds: Sequence[Points],
        *,
        door_known: DoorKnown = False,
        is_level: bool = False,
        camera_height_m: float | None = None,
    ) -> list[Prediction]:
        """Predict the states of the doors in several clouds, which may differ in form and size.

        Returns:
            One prediction a cloud, in their order; `milliseconds` is an equal share of the time of all.

        Raises:
            CloudContentError: as for a call, or one cloud in place of several.
            ConfigError: as for a call.
        """
        return self._predict(check_batch(clouds), Known(door_known, is_level, camera_height_m))

    @abstractmethod
    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        """Return the predictions of clouds for which the same is known."""

    def prepare(
        self, cloud: Points, *, is_level: bool = False, camera_height_m: float | None = None
    ) -> PreparedCloud:
        """Return the points of a cloud that are evaluated, or that represent it where all are; arguments as for a call.

        Raises:
            CloudContentError: as for a call.
            TooFewPointsError: there are not enough.
        """
        return prepare_cloud(cloud, CloudSpec(thin=True))

    def _clean(self, cloud: Points) -> CleanCloud:
        """Return the cloud that gate, network and rule get."""
        return remove_outliers(cloud) if self.removes_outliers else CleanCloud(cloud, 0.0)

    def _gate(self, clean: CleanCloud) -> Abstention | None:
        """Return the reason why the gate rejects a cloud, or None."""
        return None if self.gate is None else self.gate(clean.points, clean.outlier_share)

    def _confirm(self, prediction: Prediction, clean: CleanCloud) -> Prediction:
        """Return the prediction, without its state if the gate refuses the opening of an open door."""
        if self.gate is None or prediction.state is not DoorState.OPEN:
            return prediction
        for opening in prediction.possible_openings:
            abstention = self.gate.check_opening(clean.points, opening)
            if abstention is not None:
                return prediction.refuse(abstention)
        return prediction

    def _check_hint(self, known: Known) -> None:
        if known.hint is not None:
            raise ConfigError(
                f"{self} sees the whole cloud and cannot use a rough place",
                field="door_known",
                expected="True or False",
            )

    def warm_up(self) -> None:
        """Make the first call as quick as later ones; the process keeps freed memory from then on."""
        keep_freed_memory()
