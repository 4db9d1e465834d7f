# SPDX-License-Identifier: Apache-2.0
"""Network with its weights, on the path that training took: clean, sample, gate, network, decode."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from doorstate.clouds.normalization import Input
from doorstate.clouds.outliers import CleanCloud
from doorstate.clouds.preparation import MIN_POINTS, CloudSpec, PreparedCloud, prepare_cloud
from doorstate.clouds.shape import check_single_cloud
from doorstate.errors import ConfigError, TooFewPointsError
from doorstate.inference.abstention import Abstention
from doorstate.inference.backends import Backend, load_backend, run_by_size
from doorstate.inference.budget import largest_within_budget
from doorstate.inference.decode import decode
from doorstate.inference.gate import DEFAULT_GATE, Gate
from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import DEFAULT_NETWORK, Predictor
from doorstate.networks.card import WeightsCard
from doorstate.types import Points

_NO_POINTS = np.empty((0, 3), np.float32)


class NetworkPredictor(Predictor):
    """Network with its weights, and the preparation they were trained with.

    Args:
        backend: network with its weights.
        num_points: points that the network evaluates; None takes the number recorded with the weights.
        thin: sample from some rows and columns of an organized cloud, which is several times quicker, and not from
            all as in training (clouds.preparation).
        gate: rejects clouds in which too much is missing; None rejects nothing.
        remove_outliers: remove outliers before gate and network; None takes the setting recorded with the weights.
        clock: seconds, for `milliseconds` and time budgets.

    Raises:
        ConfigError: fewer than 128 points, another number than the backend takes, or weights for clouds of another kind
            (`for_card` returns the class that takes them).
    """

    input: ClassVar[Input] = "whole"
    """Clouds that the network takes."""

    def __init__(
        self,
        backend: Backend,
        num_points: int | None = None,
        *,
        thin: bool = True,
        gate: Gate | None = DEFAULT_GATE,
        remove_outliers: bool | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.backend = backend
        self.card = backend.card
        self.num_points = self.card.points_in_use if num_points is None else num_points
        self.gate = gate
        self.removes_outliers = self.card.remove_outliers if remove_outliers is None else remove_outliers
        self.clock = clock
        if self.card.input != self.input:
            raise ConfigError(f"these weights take {self.card.input} clouds, not {self.input} ones")
        if self.num_points < MIN_POINTS:
            raise ConfigError(
                f"{num_points} points are too few for a network", expected=f"{MIN_POINTS} or more"
            )
        if backend.num_points not in (None, self.num_points):
            raise ConfigError(
                f"the exported network takes {backend.num_points} points, not {num_points}: export it again"
            )
        self.spec = CloudSpec(
            num_points=self.num_points,
            thin=thin,
            max_depth_m=self.card.max_depth_m,
            remove_outliers=self.removes_outliers,
        )
        self._spec_of_clean = self.spec.model_copy(update={"remove_outliers": False})

    @classmethod
    def from_weights(
        cls,
        name_or_path: str | Path = DEFAULT_NETWORK,
        *,
        num_points: int | None = None,
        budget_ms: float | None = None,
        thin: bool = True,
        gate: Gate | None = DEFAULT_GATE,
        threads: int | None = None,
        backend: str | None = None,
        device: str = "cpu",
        clock: Callable[[], float] = time.perf_counter,
    ) -> NetworkPredictor:
        """Load packaged weights by name or a weights file by path; arguments as in `Predictor.load` and the class.

        Raises:
            ConfigError: both points and a budget, or a budget that is not above zero.
            WeightsError: no such weights, or they cannot be used.
            MissingExtraError: torch is needed and not installed.
        """
        if budget_ms is not None and num_points is not None:
            raise ConfigError("give a number of points or a time budget, not both", field="budget_ms")
        if budget_ms is not None and not budget_ms > 0:
            raise ConfigError(
                f"no cloud is processed in {budget_ms} ms", field="budget_ms", expected="a time above zero"
            )
        if threads is not None and threads < 1:
            raise ConfigError(f"a call needs a thread, not {threads}", field="threads", expected="1 or more")
        loaded = load_backend(name_or_path, threads, backend, device)

        predictor = cls.for_card(loaded.card)

        def with_points(count: int | None) -> NetworkPredictor:
            return predictor(loaded, count, thin=thin, gate=gate, clock=clock)

        if budget_ms is None:
            return with_points(num_points)
        if loaded.num_points is not None:
            return with_points(loaded.num_points)
        return largest_within_budget(with_points, loaded.card.num_points, budget_ms)

    @classmethod
    def for_card(cls, card: WeightsCard) -> type[NetworkPredictor]:
        """Return the class for the clouds that weights take."""
        if card.input == cls.input:
            return cls
        # The subclass imports this module.
        from doorstate.inference.doorway_predictor import DoorwayPredictor

        return DoorwayPredictor

    @property
    def name(self) -> str:
        return self.card.network

    def __str__(self) -> str:
        return f"{self.name}, {self.num_points} points"

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        """Return the predictions; equally large clouds pass the network together."""
        self._check_hint(known)
        started = self.clock()
        samples = [self._sample(check_single_cloud(cloud)) for cloud in clouds]
        accepted = [sample.points for sample in samples if sample.abstention is None]
        outputs = iter(run_by_size(self.backend, accepted))
        milliseconds = (self.clock() - started) * 1000 / max(1, len(samples))

        def answer(sample: _Sample) -> Prediction:
            if sample.abstention is not None:
                return Prediction.abstain(sample.abstention, len(sample.points), milliseconds)
            prediction = decode(
                next(outputs),
                self.card.abstain_below,
                len(sample.points),
                milliseconds,
                door_known=known.has_door,
            )
            return self._confirm(prediction, sample.clean)

        return [answer(sample) for sample in samples]

    def prepare(
        self, cloud: Points, *, is_level: bool = False, camera_height_m: float | None = None
    ) -> PreparedCloud:
        """Return the points that the network evaluates.

        Raises:
            CloudContentError: as for a call.
            TooFewPointsError: there are not enough.
        """
        return self._prepare(cloud, self.spec)

    def _prepare(self, cloud: Points, spec: CloudSpec) -> PreparedCloud:
        return self._enough(prepare_cloud(cloud, spec))

    def _enough(self, prepared: PreparedCloud) -> PreparedCloud:
        """Return the prepared cloud, if the network takes that many points.

        Raises:
            TooFewPointsError: it does not.
        """
        if self.backend.num_points is not None and len(prepared.points) < self.backend.num_points:
            raise TooFewPointsError(
                f"too few points: {len(prepared.points)} distinct, but the exported network takes "
                f"{self.backend.num_points}",
                hint="export it again with fewer points",
            )
        return prepared

    def warm_up(self) -> None:
        """Run once on noise, so that the first cloud is as quick as later ones; the process keeps freed memory."""
        super().warm_up()
        cloud = np.random.default_rng(0).normal(2.0, 1.0, (self.num_points, 3)).astype(np.float32)
        # All points of noise could be outliers, and an exported network takes only as many points as it was made for.
        spec = CloudSpec(num_points=self.num_points, remove_outliers=False)
        self.backend(prepare_cloud(cloud, spec).points[None])

    def _sample(self, cloud: Points) -> _Sample:
        """Clean and sample one cloud, unless it has too few points, and check it with the gate."""
        clean = self._clean(cloud)
        try:
            points = self._prepare(clean.points, self._spec_of_clean).points
        except TooFewPointsError as error:
            return _Sample(_NO_POINTS, clean, Abstention.from_error(error))
        return _Sample(points, clean, self._gate(clean))


class _Sample(NamedTuple):
    """Points for the network, and the reason if it must not be run on them."""

    points: Points  # (n, 3) in farthest-point order
    clean: CleanCloud  # that they were sampled from
    abstention: Abstention | None = None
