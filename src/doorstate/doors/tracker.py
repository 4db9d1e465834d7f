# SPDX-License-Identifier: Apache-2.0
"""Doors of a list over time: one sighting of each after every cloud, and an event whenever one is found changed.

What is not seen has no state now. A door that has not been seen for a while is reported as such, once, and so is every
door when the clock goes back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from doorstate.doors.camera_place import CameraPlace, MissingPlace
from doorstate.doors.matching import Match, expected_door, match_doors
from doorstate.doors.named_door import KINDS_WITHOUT_STATE, NamedDoor
from doorstate.doors.sighting import NOT_SEEN, USUAL_VIEW, NotSeenCode, Sighting, View, why_hidden
from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.known import MAX_DISTANCE_M, DoorHint
from doorstate.inference.prediction import Prediction
from doorstate.inference.state_filter import FilteredState, StateFilter
from doorstate.types import DoorState

_NO_DOOR = ("no_doorway", "no_door")  # reasons of a cloud that was searched

Ask = Callable[[DoorHint], Door | None]
"""Asks a network for the state of a door at a rough place of the same cloud."""


class DoorEvent(NamedTuple):
    """A change of one door; states are names of states, or `not_seen`."""

    door: str
    from_state: str
    to_state: str
    time_s: float  # of the cloud that shows it; of the last that showed the door where it was lost
    certainty: float | None = None  # probability of the new state by the filter
    frame: str = ""  # name of the cloud


class TrackedFrame(NamedTuple):
    """What one cloud shows of the doors of a list."""

    sightings: tuple[Sighting, ...]  # one for each door of the list
    names: tuple[str | None, ...]  # of the prediction's doors; None for a door that is not in the list
    events: tuple[DoorEvent, ...] = ()


@dataclass
class _Track:
    """Memory of one door."""

    filter: StateFilter = field(default_factory=StateFilter)
    last_state: DoorState | None = None
    last_seen_s: float | None = None
    reported: str = NOT_SEEN  # state of the last event


class DoorTracker:
    """Follow the doors of a list. Not for several threads.

    Args:
        doors: doors of the list.
        lost_s: time without a state after which a door counts as not seen; chosen: a robot turns round in it.
        max_asked: doors of one cloud that are asked for at their places, the nearest first.
    """

    def __init__(self, doors: Sequence[NamedDoor], *, lost_s: float = 10.0, max_asked: int = 2) -> None:
        self._doors = tuple(doors)
        self._lost_s, self._max_asked = lost_s, max_asked
        self._tracks = {door.id: _Track() for door in self._doors}
        self._stamp_s = -math.inf

    @property
    def last_seen(self) -> dict[str, tuple[str, float]]:
        """State and time of the last cloud that showed a state, by the name of a door that counts as seen."""
        return {
            name: (str(track.last_state), track.last_seen_s)
            for name, track in self._tracks.items()
            if track.reported != NOT_SEEN and track.last_seen_s is not None
        }

    def update(
        self,
        prediction: Prediction,
        camera: CameraPlace | MissingPlace,
        stamp_s: float,
        view: View = USUAL_VIEW,
        *,
        frame: str = "",
        ask: Ask | None = None,
    ) -> TrackedFrame:
        """Add one cloud.

        Args:
            prediction: prediction for the cloud.
            camera: pose of the camera at that moment.
            stamp_s: time of the cloud; after one that is earlier than the last, all doors count as not seen.
            view: part of the plan that the cloud shows.
            frame: name of the cloud, for events.
            ask: asks for doors in view that were not found.
        """
        events = self._begin(stamp_s)
        found: dict[str, Sighting] = {}
        names: tuple[str | None, ...] = (None,) * len(prediction.doors)
        if isinstance(camera, CameraPlace):
            matches = match_doors(prediction.doors, self._doors, camera)
            names = tuple(None if match.door is None else self._doors[match.door].id for match in matches)
            found = self._found(prediction.doors, matches, camera)
            if ask is not None:
                found |= self._asked(found, camera, view, ask)
        sightings = tuple(
            self._track(found.get(door.id) or self._hidden(door, prediction, camera, view), stamp_s)
            for door in self._doors
        )
        changes = (self._change(sighting, stamp_s, frame) for sighting in sightings)
        return TrackedFrame(sightings, names, (*events, *(event for event in changes if event is not None)))

    def miss(self, reason: str, stamp_s: float) -> TrackedFrame:
        """Add a moment without a cloud: no door is seen, for a reason that a user can read.

        Args:
            reason: why there is no cloud.
            stamp_s: time of the moment, as for `update`.
        """
        events = self._begin(stamp_s)
        missed = (Sighting(door.id, code="refused", detail=reason) for door in self._doors)
        return TrackedFrame(tuple(self._track(sighting, stamp_s) for sighting in missed), (), tuple(events))

    def end(self) -> tuple[DoorEvent, ...]:
        """Return the events that let every door count as not seen, at the end of a stream."""
        return tuple(self._lost(name) for name, track in self._tracks.items() if track.reported != NOT_SEEN)

    def _begin(self, stamp_s: float) -> list[DoorEvent]:
        """Return the events of doors that have not been seen for too long, or all where the clock went back."""
        has_gone_back, self._stamp_s = stamp_s < self._stamp_s, stamp_s
        events = [
            self._lost(name)
            for name, track in self._tracks.items()
            if track.reported != NOT_SEEN
            and (has_gone_back or stamp_s - (track.last_seen_s or 0.0) >= self._lost_s)
        ]
        if has_gone_back:
            self._tracks = {name: _Track() for name in self._tracks}
        return events

    def _lost(self, name: str) -> DoorEvent:
        track = self._tracks[name]
        event = DoorEvent(name, track.reported, NOT_SEEN, track.last_seen_s or 0.0)
        track.reported, track.filter = NOT_SEEN, StateFilter()
        return event

    def _found(
        self, doors: Sequence[Door], matches: Sequence[Match], camera: CameraPlace
    ) -> dict[str, Sighting]:
        found: dict[str, Sighting] = {}
        for door, match in zip(doors, matches, strict=True):
            if match.door is not None:
                named = self._doors[match.door]
                found[named.id] = _seen(named, door, camera)
            for number in match.candidates:
                named = self._doors[number]
                others = [self._doors[other].id for other in match.candidates if other != number]
                detail = ", ".join(others) or "a door that is not in the list"
                found.setdefault(named.id, Sighting(named.id, code="not_told_apart", detail=detail))
        return found

    def _asked(self, found: Iterable[str], camera: CameraPlace, view: View, ask: Ask) -> dict[str, Sighting]:
        """Return sightings of doors that are in view and were not found, by asking at their places."""
        places = {}
        for door in self._doors:
            if door.id not in found and door.frame == camera.frame:
                place = expected_door(door, camera)
                if why_hidden(place, view) is None and math.hypot(*place[:2]) <= MAX_DISTANCE_M:
                    places[door] = place
        asked = {}
        nearest = sorted(places, key=lambda door: math.hypot(*places[door][:2]))[: self._max_asked]
        for named in nearest:
            answer = ask(DoorHint(*places[named], width_m=min(named.width_m, 3.0)))
            if answer is None:
                continue
            # The candidate that a network takes for the door may be its neighbour.
            number = match_doors([answer], self._doors, camera)[0].door
            if number is not None and self._doors[number] is named:
                asked[named.id] = replace(_seen(named, answer, camera), asked=True)
        return asked

    def _hidden(
        self, door: NamedDoor, prediction: Prediction, camera: CameraPlace | MissingPlace, view: View
    ) -> Sighting:
        """Return the sighting of a door that was not found."""
        if isinstance(camera, MissingPlace):
            return Sighting(door.id, code="no_pose", detail=camera.reason)
        if door.frame != camera.frame:
            return Sighting(door.id, code="other_map", detail=camera.frame)
        place = expected_door(door, camera)
        is_front = door.is_front(camera.pose.x_m, camera.pose.y_m)
        hidden: tuple[NotSeenCode, str] | None = why_hidden(place, view)
        abstention = prediction.abstention
        if (
            hidden is None
            and abstention is not None
            and not prediction.doors
            and abstention.code not in _NO_DOOR
        ):
            hidden = "refused", prediction.reason
        code, detail = hidden or ("not_found", f"{math.hypot(*place[:2]):.1f}")
        return Sighting(door.id, code=code, detail=detail, is_front=is_front)

    def _track(self, sighting: Sighting, stamp_s: float) -> Sighting:
        """Return a sighting with what earlier clouds showed, and remember this one."""
        track = self._tracks[sighting.id]
        filtered: FilteredState | None = None
        if sighting.door is not None:
            filtered = track.filter.update(Prediction.from_doors([sighting.door], [], 0, 0.0), stamp_s)
            if sighting.door.state is not None:
                track.last_state, track.last_seen_s = sighting.door.state, stamp_s
        return replace(
            sighting, filtered=filtered, last_state=track.last_state, last_seen_s=track.last_seen_s
        )

    def _change(self, sighting: Sighting, stamp_s: float, frame: str) -> DoorEvent | None:
        track, filtered = self._tracks[sighting.id], sighting.filtered
        # The filter may still hold a state that this cloud does not show.
        if filtered is None or filtered.state is None or filtered.state != sighting.state:
            return None
        if track.reported == filtered.state:
            return None
        before, track.reported = track.reported, str(filtered.state)
        certainty = filtered.probabilities[filtered.state]
        return DoorEvent(sighting.id, before, track.reported, stamp_s, certainty, frame)


def _seen(named: NamedDoor, door: Door, camera: CameraPlace) -> Sighting:
    if named.kind in KINDS_WITHOUT_STATE and door.state is not None:
        door = door.refuse(Abstention("kind_without_state", {"kind": str(named.kind)}))
    return Sighting(named.id, door, is_front=named.is_front(camera.pose.x_m, camera.pose.y_m))
