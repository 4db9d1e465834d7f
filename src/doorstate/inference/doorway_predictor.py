# SPDX-License-Identifier: Apache-2.0
"""Network for crops: from a raw, tilted cloud to every door in it.

Each cloud is cleaned, checked, turned level and searched for doorways; the crops of all candidates pass the network
together. Its answers are placed in the level sensor frame, the likeliest of those that overlap, and checked one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from doorstate.clouds.measured import is_measured
from doorstate.clouds.preparation import MIN_POINTS, PreparedCloud, prepare_cloud, too_few_points
from doorstate.clouds.shape import check_single_cloud
from doorstate.clouds.units import check_units
from doorstate.doorways.crop import CropSpec, crop_cloud
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.upright import find_upright_doorways
from doorstate.errors import TooFewPointsError
from doorstate.inference.abstention import Abstention
from doorstate.inference.backends import CloudOutputs, run_by_size
from doorstate.inference.door import Door
from doorstate.inference.doorway_answers import Answer, decide_doors, refused_candidate
from doorstate.inference.doorway_check import DoorwayCheck
from doorstate.inference.known import DoorKnown, Known
from doorstate.inference.known_doorways import hinted_doorways
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.prediction import Prediction
from doorstate.inference.tilt import Tilt
from doorstate.types import Points

MAX_DOORS = 8  # of a cloud
_GIVE_TILT = {"pitch_deg": None, "roll_deg": None}  # parameters that tell what the cloud does not
_SAMPLE_POINTS = 16_384  # of a cloud, to check its units


@dataclass(frozen=True, eq=False)
class _Scene:
    """Cloud that was searched for doorways, or the reason why it was not."""

    cloud: Points  # level, without outliers
    num_points: int  # measured, of a sample
    abstention: Abstention | None = None
    tilt: Tilt | None = None
    doorways: tuple[Doorway, ...] = ()
    crops: tuple[PreparedCloud, ...] = ()  # of the doorways
    asked: frozenset[int] = frozenset()  # numbers of the doorways at the place of a known door
    refused: tuple[Door, ...] = ()  # candidates with too few points


class DoorwayPredictor(NetworkPredictor):
    """Network for the clouds around doorways, and the search for them; arguments as in `NetworkPredictor`.

    Predictions have `doors` and `refused`, in the level sensor frame.
    """

    input = "doorway"

    @property
    def crop_spec(self) -> CropSpec:
        """Crops that the network takes."""
        return CropSpec(num_points=self.num_points)

    def prepare(
        self, cloud: Points, *, is_level: bool = False, camera_height_m: float | None = None
    ) -> PreparedCloud:
        """Return the points of all crops in the level sensor frame; of the level cloud without a candidate.

        Raises:
            CloudContentError: as for a call.
            TooFewPointsError: there are not enough.
        """
        known = Known(is_level=is_level, camera_height_m=camera_height_m)
        scene = self._search(check_single_cloud(cloud), known)
        if not scene.crops:
            return prepare_cloud(scene.cloud, self._spec_of_clean)
        pairs = zip(scene.doorways, scene.crops, strict=True)
        points = np.concatenate([doorway.to_sensor(crop.points) for doorway, crop in pairs])
        return PreparedCloud(points, np.concatenate([crop.indices for crop in scene.crops]))

    def candidates(
        self,
        cloud: Points,
        *,
        door_known: DoorKnown = False,
        is_level: bool = False,
        camera_height_m: float | None = None,
    ) -> list[tuple[Doorway, PreparedCloud]]:
        """Return the candidate doorways and the crops that the network gets for them.

        The best comes first; with a rough place, those at the place do. There are none in a cloud that is refused.
        Arguments are those of a call.

        Raises:
            CloudContentError: as for a call.
        """
        known = Known(door_known, is_level, camera_height_m)
        scene = self._search(check_single_cloud(cloud), known)
        return list(zip(scene.doorways, scene.crops, strict=True))

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        started = self.clock()
        scenes = [self._search(check_single_cloud(cloud), known) for cloud in clouds]
        crops = [crop.points for scene in scenes for crop in scene.crops]
        outputs = iter(run_by_size(self.backend, crops))
        predictions = [
            self._decide(scene, [next(outputs) for _ in scene.crops], known.hint is not None)
            for scene in scenes
        ]
        milliseconds = (self.clock() - started) * 1000 / max(1, len(scenes))
        return [replace(prediction, milliseconds=milliseconds) for prediction in predictions]

    def _search(self, cloud: Points, known: Known) -> _Scene:
        """Clean and level one cloud, unless it shows too little, and find and crop its doorways."""
        try:
            num_points = _check_points(cloud)
        except TooFewPointsError as error:
            return _Scene(cloud, 0, Abstention.from_error(error))
        clean = self._clean(cloud)
        abstention = None if self.gate is None else self.gate.check_view(clean.points, clean.outlier_share)
        if abstention is not None:
            return _Scene(clean.points, num_points, abstention)
        level, doorways = find_upright_doorways(
            clean.points, is_level=known.is_level, camera_height_m=known.camera_height_m
        )
        if level.refusal is not None:
            abstention = Abstention(level.refusal.code, level.refusal.values, suggestions=_GIVE_TILT)
            return _Scene(level.points, num_points, abstention)
        tilt = None if level.source == "given" else Tilt.of(level)
        scene = _Scene(level.points, num_points, tilt=tilt)
        if known.hint is None:
            return self._crop(scene, doorways, set(doorways) if known.has_door else set())
        if level.floor_z_m is None:
            return replace(scene, abstention=Abstention("no_floor"))
        asked = hinted_doorways(doorways, known.hint, level.points, level.floor_z_m)
        others = [doorway for doorway in doorways if doorway not in asked]
        return self._crop(scene, [*asked, *others], set(asked))

    def _crop(self, scene: _Scene, doorways: Sequence[Doorway], asked: set[Doorway]) -> _Scene:
        """Return the scene with its crops; candidates with too few points for the network are refused."""
        kept, crops, refused = [], [], []
        for doorway in doorways:
            try:
                crops.append(self._enough(crop_cloud(scene.cloud, doorway, self.crop_spec)))
                kept.append(doorway)
            except TooFewPointsError as error:
                refused.append(refused_candidate(doorway, Abstention.from_error(error)))
        numbers = frozenset(number for number, doorway in enumerate(kept) if doorway in asked)
        return replace(scene, doorways=tuple(kept), crops=tuple(crops), asked=numbers, refused=tuple(refused))

    def _decide(self, scene: _Scene, outputs: Sequence[CloudOutputs], has_hint: bool) -> Prediction:
        """Return the prediction of a scene from the outputs for its crops."""
        num_points = sum(len(crop.points) for crop in scene.crops) or scene.num_points
        abstention = scene.abstention
        if not all(output.are_valid() for output in outputs):
            abstention = Abstention("invalid_outputs")
        if abstention is not None:
            return replace(Prediction.abstain(abstention, num_points), tilt=scene.tilt)
        answers = [
            Answer(doorway, output, number in scene.asked)
            for number, (doorway, output) in enumerate(zip(scene.doorways, outputs, strict=True))
        ]
        decided = decide_doors(answers, self.card)
        doors = sorted(decided.doors, key=lambda door: door.remoteness_m)
        if has_hint and decided.known is not None:
            doors = [decided.known, *(door for door in doors if door is not decided.known)]
        checked = self._check(doors[:MAX_DOORS], scene.cloud)
        refused = (*decided.refused, *scene.refused)
        return Prediction.from_doors(checked, refused, num_points, 0.0, scene.tilt)

    def _check(self, doors: Sequence[Door], cloud: Points) -> list[Door]:
        """Return the doors with what the gate says of them."""
        if self.gate is None:
            return list(doors)
        checks = self.gate.check_doorways(cloud, doors)
        return [
            door if door.state is None else _with_check(door, check)
            for door, check in zip(doors, checks, strict=True)
        ]


def _with_check(door: Door, check: DoorwayCheck) -> Door:
    if check.abstention is not None:
        return door.refuse(check.abstention)
    return replace(door, leaf_seen=check.leaf_seen)


def _check_points(cloud: Points) -> int:
    """Return the number of measured points of a sample, after checking their units.

    Raises:
        CloudContentError: units that cannot be metres.
        TooFewPointsError: fewer than 128 points were measured.
    """
    flat = cloud.reshape(-1, 3)
    # An odd step meets all columns of an image.
    for step in (len(flat) // _SAMPLE_POINTS | 1, 1):
        sample = flat[::step].astype(np.float32)
        points = sample[is_measured(sample)]
        if len(points) >= MIN_POINTS:
            check_units(points)
            return len(points)
    raise too_few_points(f"{len(points)} measured")
