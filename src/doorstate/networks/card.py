# SPDX-License-Identifier: Apache-2.0
"""Card of a weights file: the network it is for and how its clouds are prepared; needs no torch."""

from __future__ import annotations

import re
from typing import Any, Literal, Self

from pydantic import Field, ValidationError

from doorstate import __version__
from doorstate._documents import parse_json
from doorstate._models import FrozenModel, Name
from doorstate.clouds.normalization import NORMALIZATIONS, SCALE_M, Input, Normalization
from doorstate.clouds.preparation import MAX_NUM_POINTS, CloudSpec
from doorstate.errors import WeightsError, first_validation_error
from doorstate.networks.door_calibration import DoorCalibration
from doorstate.types import STATES

CARD_KEY = "doorstate"  # of the card, in the metadata of weights files and exported networks
DIGEST_KEY = "digest"  # of the file, in its card (networks.digest)
_DIGEST = re.compile("sha256:[0-9a-f]{64}")


class HeadErrors(FrozenModel):
    """Standard errors of the heads on validation doors: 68 % of the errors are smaller."""

    along_m: float = Field(gt=0)  # of the opening's middle, along the wall
    across_m: float = Field(gt=0)
    yaw_deg: float = Field(gt=0)
    width_m: float = Field(gt=0)  # of the opening
    angle_deg: dict[str, float] = Field(default_factory=dict)  # by state


class Guarantee(FrozenModel):
    """Largest share of wrong answers in scenes that are drawn as the validation scenes were.

    It holds for the states that are given to doors among the finder's candidates, all kinds of doors together.
    """

    method: Literal["learn-then-test"] = "learn-then-test"  # training.guarantee
    wrong_share: float = Field(gt=0, lt=1)
    confidence: float = Field(gt=0, lt=1)  # probability, over the draw of the scenes, that it holds
    scenes: int = Field(ge=1)  # one sample of each
    answered: int = Field(ge=0)  # of these samples
    wrong: int = Field(ge=0)  # of the answered ones


class WeightsCard(FrozenModel):
    """Network, preparation of clouds, calibration and origin of a weights file."""

    network: Name
    network_options: dict[str, Any] = Field(default_factory=dict)
    num_points: int = Field(ge=1, le=MAX_NUM_POINTS)  # per cloud in training
    # Per cloud in use, if fewer are as good.
    default_points: int | None = Field(default=None, ge=1, le=MAX_NUM_POINTS)
    heads: tuple[str, ...] = ()  # besides the state, by name (networks.heads)
    input: Input = "whole"
    scale_m: float = Field(default=SCALE_M, gt=0)
    states: tuple[str, ...] = STATES
    max_depth_m: float | None = Field(default=None, gt=0)  # range of the camera of the training clouds
    remove_outliers: bool = True  # before sampling, whatever the training clouds were
    # Logits are divided by it (training.calibration).
    temperature: float = Field(default=1.0, ge=1e-3, le=1e3)
    abstain_below: float = Field(default=0.0, ge=0, lt=1)  # abstain if no state is more probable
    guarantee: Guarantee | None = None  # of `abstain_below`; None: chosen by counting, without one
    errors: HeadErrors | None = None  # on validation doors; None: not measured
    # Of crops, with the finder's score; None: the head `door` counts as it is.
    door_calibration: DoorCalibration | None = None
    trained_on: str = ""
    doorstate_version: str = __version__

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the card of a JSON text, which may hold the digest of its file too.

        Raises:
            WeightsError: it is no card.
        """
        try:
            content = parse_json(text, WeightsError)
            digest = content.pop(DIGEST_KEY, None) if isinstance(content, dict) else None
            if digest is not None and not (isinstance(digest, str) and _DIGEST.fullmatch(digest)):
                raise WeightsError("is no SHA-256", field=DIGEST_KEY)
            return cls.model_validate(content)
        except ValidationError as error:
            raise WeightsError(first_validation_error(error)) from error

    @property
    def normalization(self) -> Normalization:
        """Normalisation of the network's clouds."""
        return NORMALIZATIONS[self.input]

    @property
    def points_in_use(self) -> int:
        """Number of points per cloud in use."""
        return self.default_points or self.num_points

    @property
    def spec(self) -> CloudSpec:
        """Preparation of the clouds that these weights take by default."""
        return CloudSpec(
            num_points=self.points_in_use,
            max_depth_m=self.max_depth_m,
            remove_outliers=self.remove_outliers,
        )
