# SPDX-License-Identifier: Apache-2.0
"""Reason for a prediction without a state, as data and as a sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from doorstate.errors import DoorstateError, TooFewPointsError, WriteParameter, python_parameter

AbstentionCode = Literal[
    "too_few_points",  # nothing or hardly anything was measured
    "low_coverage",
    "outliers",  # too many points float in mid-air
    "points_behind_camera",
    "too_near",
    "too_far",
    "too_small",
    "narrow_view",
    "tilt_no_planes",  # these by `clouds.vertical`
    "tilt_against_wall",
    "tilt_one_plane",
    "tilt_too_steep",
    "tilt_ambiguous",
    "tilt_upside_down",
    "tilt_unsure",
    "hole",  # glass or missing data: no free way is visible
    "invalid_outputs",  # of the network: not finite, or no probabilities
    "door_hole",  # a dark or glass leaf, or an open door into nothing
    "opening_not_seen",  # called open, but the floor behind the opening was not measured
    "door_too_near",  # these by the check of each doorway
    "door_out_of_range",
    "door_out_of_view",
    "door_occluded",
    "door_dark",
    "door_glass",
    "door_not_measured",
    "opening_blocked",  # called open, but a surface fills the opening
    "leaf_out_of_view",
    "no_floor",  # neither in view nor known
    "kind_without_state",  # of a door of a list
    "no_doorway",  # no wall with a place for a door
    "no_door",
    "unsure",
    "no_rule_result",
    "unusable_cloud",
    "damaged_message",
    "no_message",
    "camera_gone",
    "stale_frame",
]

SENTENCES: dict[AbstentionCode, str] = {
    "too_few_points": "too few points were measured: at least {min_points} are needed",
    "low_coverage": "only {share:.0%} of the cloud was measured: at least {min_share:.0%} are needed",
    "outliers": "{share:.1%} of the points float before or behind every surface: at most {max_share:.0%} may",
    "points_behind_camera": "{share:.0%} of the points lie behind the camera: a scan, or a cloud in another frame",
    "too_near": "half of the points are within {median_m:.2f} m: something is before the camera",
    "too_far": "half of the points are beyond {median_m:.1f} m: too far away for a door",
    "too_small": "the surfaces are only {width_m:.2f} m wide and {height_m:.2f} m high: too little for a door",
    "narrow_view": "the view is only {view_deg:.0f} degrees wide: at least {min_view_deg:g} are needed",
    "hole": "{share:.0%} of the view ahead is a hole without a floor {free_reach_m:g} m away: glass or missing data",
    "tilt_no_planes": "the tilt is unknown: only {share:.0%} of the view is flat, at least {min_share:.0%} must be",
    "tilt_against_wall": (
        "the tilt is unknown: half of the points are within {ahead_m:.2f} m, something is before the camera"
    ),
    "tilt_one_plane": "the tilt is unknown: all surfaces face one way, such as a wall or a floor alone",
    "tilt_too_steep": "the camera looks more than {max_pitch_deg:g} degrees up or down",
    "tilt_ambiguous": (
        "the tilt is unknown: a pitch of {pitch_deg:.0f} and a roll of {roll_deg:.0f} degrees, or of "
        "{other_pitch_deg:.0f} and {other_roll_deg:.0f}"
    ),
    "tilt_upside_down": (
        "the tilt is unknown: the camera may be upside down, with a roll of {roll_deg:.0f} or "
        "{other_roll_deg:.0f} degrees"
    ),
    "tilt_unsure": "the tilt is unsure: its error is {error_deg:.1f} degrees, at most {max_error_deg:g} may be",
    "invalid_outputs": "the network's outputs are not valid numbers: its weights or the machine are damaged",
    "door_hole": (
        "a hole like a doorway, {width_m:.1f} m wide and {height_m:.1f} m high, {distance_m:.1f} m away, and no floor "
        "behind it: a dark or glass leaf, or an open door into nothing"
    ),
    "opening_not_seen": (
        "called open, but only {share:.0%} of the rays to the floor behind the opening came back, {min_share:.0%} are "
        "needed: a dark or glass leaf, or missing data"
    ),
    "door_too_near": "what surrounds the door's hole is {range_m:.2f} m away: nearer than the camera measures",
    "door_out_of_range": "the wall of the door is {range_m:.1f} m away, at the end of what the camera measures",
    "door_out_of_view": "too little of the door is in view",
    "door_occluded": "something stands before {share:.0%} of the door",
    "door_dark": (
        "nothing came back from {share:.0%} of the opening, though its frame was measured: closed with a dark or "
        "glossy leaf, or open into nothing"
    ),
    "door_glass": (
        "{share:.0%} of the opening was seen through, but not the floor behind it, and nothing came back from "
        "{missing_share:.0%}: glass, or missing data"
    ),
    "door_not_measured": "{share:.0%} of the opening and the floor before it were not measured: missing data",
    "opening_blocked": "called open, but a surface fills {share:.0%} of the opening",
    "leaf_out_of_view": "called semi-open, but no leaf was seen: it is out of view, or nothing came back from it",
    "no_floor": "the floor is not in view, and the height of the camera is not given",
    "kind_without_state": "a {kind} door has no state",
    "no_doorway": "no wall in view has a place for a door",
    "no_door": "there seems to be no door: its probability is {probability:.2f}",
    "unsure": "unsure: {state} has probability {probability:.2f}, these weights need {min_probability:.2f}",
    "no_message": "no message for {silence_s:g} s",
    "camera_gone": "no camera: {cause}",
    "stale_frame": "the image was {age_s:.1f} s old when it was answered: at most {max_age_s:g} may be",
}


@dataclass(frozen=True)
class Abstention:
    """Reason why a predictor gives no state.

    Args:
        code: kind of the reason, for programs.
        values: measured values and their limits, by name.
        message: sentence of a rule or of another library; empty where the code has its own sentence.
        suggestions: parameters by name and values to try, such as `{"frame": "optical"}`.
        error: error that made the cloud unusable, if one did.
    """

    code: AbstentionCode
    values: Mapping[str, float | str] = field(default_factory=dict)
    message: str = ""
    suggestions: Mapping[str, object] = field(default_factory=dict)
    error: DoorstateError | None = field(default=None, compare=False, repr=False)

    @classmethod
    def from_error(cls, error: DoorstateError) -> Abstention:
        """Return the reason of a cloud or message that cannot be used."""
        code: AbstentionCode = "too_few_points" if isinstance(error, TooFewPointsError) else "unusable_cloud"
        return cls(code, message=str(error), error=error)

    def __str__(self) -> str:
        return self.describe()

    def describe(self, parameter: WriteParameter = python_parameter) -> str:
        """Return one sentence.

        Args:
            parameter: writes a suggested parameter as the surface spells it.
        """
        if self.error is not None:
            return self.error.describe(parameter)
        sentence = self.message or SENTENCES[self.code].format(**self.values)
        tries = " ".join(parameter(name, value) for name, value in self.suggestions.items())
        return f"{sentence}; try {tries}" if tries else sentence
