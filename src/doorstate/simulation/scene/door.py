# SPDX-License-Identifier: Apache-2.0
"""Parameters of a door and of its opening; boxes are in `door_boxes`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from doorstate._models import Degrees, FrozenModel, Metres
from doorstate.simulation.scene.fittings import Fitting
from doorstate.simulation.scene.handle import Handle
from doorstate.types import Hinge, Swing

DoorKind = Literal[
    "single",
    "double_equal",
    "double_unequal",
    "sliding",
    "glazed",
    "full_glass",
    "sliding_double",
    "folding",
    "revolving",
]
LeafMaterial = Literal["matte", "dark", "gloss"]


class Door(FrozenModel):
    """A door in its wall; the defaults are the door of the paper's presets.

    The paper states no sizes. An opening of 0.90 x 2.10 m, a wall of 0.15 m and a leaf of 0.04 m are usual in Turkey
    and assumed here (docs/data-card.md). `hinge` and `swing` describe the active leaf. For a sliding door `hinge` is
    the side it opens to, and `swing` the wall face it runs along; for a folding door, the side and the face that its
    leaves fold to. A revolving door turns in a drum across the wall, and its opening is the inside of the drum.
    """

    opening_width_m: Metres = 0.90
    opening_height_m: Metres = 2.10
    hinge: Hinge = "left"
    swing: Swing = "towards"
    leaf_thickness_m: Metres = 0.04
    leaf_gap_m: Metres = 0.003  # to the jambs and the head
    leaf_floor_gap_m: Metres = 0.006
    wall_thickness_m: Metres = 0.15
    wall_height_m: Metres = 2.6
    wall_half_length_m: Metres = 6.0
    jamb_thickness_m: Metres = 0.03
    casing_width_m: Metres = 0.06
    casing_thickness_m: Metres = 0.015
    stop_width_m: Metres = 0.012  # by which the stop projects from the jamb
    stop_depth_m: Metres = 0.03
    floor_size_m: Metres = 16.0
    kind: DoorKind = "single"
    leaf_recess_m: Metres = 0.0  # of the leaf's face behind the wall's; negative in front of it
    hinge_offset_m: Metres = 0.0  # of the hinge pin in front of the leaf's face
    active_share: float = 1.0  # of the total leaf width
    pane_bottom_m: Metres | None = None  # glazed leaves only
    threshold_m: Metres = 0.0
    handle: Handle | None = None
    # None, not a value, so that manifests of doors without these fields stay as they are.
    leaf_material: LeafMaterial | None = None  # of solid parts; matte if None
    fittings: tuple[Fitting, ...] | None = Field(default=None, max_length=10)  # of every leaf
    panels: Literal[2, 4] | None = None  # of a folding door: 2 at one side, if None, or 2 at each
    glass_panels: int | None = Field(
        default=None, ge=0, le=4
    )  # of a sliding, folding or revolving door; 0 if None

    @property
    def half_width_m(self) -> float:
        """Half of the width with jambs and casing."""
        return self.opening_width_m / 2 + self.jamb_thickness_m + self.casing_width_m

    @property
    def is_double(self) -> bool:
        """True for a door with a second, passive leaf."""
        return self.kind in ("double_equal", "double_unequal")

    @property
    def is_sliding(self) -> bool:
        """True for a door whose leaves move along the wall."""
        return self.kind in ("sliding", "sliding_double")

    @property
    def has_state(self) -> bool:
        """True for a door that is closed, semi-open or open; not for folding and revolving doors."""
        return self.kind not in ("folding", "revolving")

    @property
    def opens_by_share(self) -> bool:
        """True for a door that opens by a share of its way, not by an angle."""
        return self.is_sliding or not self.has_state


class Opening(FrozenModel):
    """Position of the leaves: angles of the active and the passive leaf, or the share of their way to fully open.

    The way of a sliding door is its width, that of a folding door the part of its width that folding sets free, and
    that of a revolving door a quarter of a turn.
    """

    angle_deg: Degrees = 0.0
    passive_angle_deg: Degrees = 0.0
    share: float = 0.0
