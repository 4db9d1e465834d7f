# SPDX-License-Identifier: Apache-2.0
"""Plan as an SVG picture: walls, doors with leaf and swing, robot with its field of view, distances."""

from __future__ import annotations

import math
from collections.abc import Iterator

from doorstate.pages.colors import STATE_COLORS, STATE_WORDS
from doorstate.pages.plan import Place, Plan, PlanDoor
from doorstate.pages.svg_text import svg_text

PX_PER_M = 90.0
_MARGIN_PX = (100.0, 58.0)  # for labels at the sides, and above and below
_MIN_WIDTH_M = 3.2
_VIEW_M = 0.5  # length of the edges of the view beyond the farthest door
_LABEL_M = 0.22
_STYLE = """
.paper{fill:#fff}.ink{fill:#1c1f24}.soft{fill:#5d6570}.halo{stroke:#fff}
.wall{stroke:#3b4149}.view{fill:#0072b2;fill-opacity:.07}.edge{stroke:#0072b2;stroke-opacity:.35}.ray{stroke:#8b939e}
.robot{fill:#1c1f24}.jamb{stroke:#1c1f24}
@media (prefers-color-scheme:dark){.paper{fill:#16181c}.ink{fill:#eceef1}.soft{fill:#a7aeb8}.halo{stroke:#16181c}
.wall{stroke:#aab1bb}.robot{fill:#eceef1}.jamb{stroke:#eceef1}.view{fill-opacity:.16}}
"""


class _Canvas:
    """Conversion of places to pixels; the robot looks up."""

    def __init__(self, plan: Plan, px_per_m: float) -> None:
        self.px_per_m = px_per_m
        xs, ys = zip(*plan.places, *_view_arc(plan), strict=True)
        spare = max(0.0, _MIN_WIDTH_M - (max(ys) - min(ys))) / 2
        self._top, self._left = max(*xs, 0.8), max(ys) + spare
        self.width = (max(ys) - min(ys) + 2 * spare) * self.px_per_m + 2 * _MARGIN_PX[0]
        self.height = (self._top - min(*xs, -0.35)) * self.px_per_m + 2 * _MARGIN_PX[1]

    def __call__(self, place: Place) -> str:
        """Return the pixels of a place, separated by a comma."""
        u, v = self.pixel(place)
        return f"{u:.1f},{v:.1f}"

    def pixel(self, place: Place) -> tuple[float, float]:
        """Return the pixels of a place."""
        x, y = place
        return (self._left - y) * self.px_per_m + _MARGIN_PX[0], (self._top - x) * self.px_per_m + _MARGIN_PX[
            1
        ]


def plan_svg(plan: Plan, title: str = "", px_per_m: float = PX_PER_M) -> str:
    """Return a plan as SVG; its colours follow a dark surface.

    Args:
        plan: plan.
        title: text above the drawing.
        px_per_m: pixels of a metre; texts have one size, so that they are larger beside a smaller drawing.
    """
    at = _Canvas(plan, px_per_m)
    parts = [
        *_view(plan, at),
        *(_line(start, end, at, "wall", 7) for start, end in plan.walls),
        *(part for door in plan.doors for part in _door(door, at)),
        *(part for door in plan.doors for part in _distance(door, at)),
        *_robot(at),
        *_scale(at),
        *(part for door in plan.doors for part in _door_text(door, at)),
    ]
    if title:
        parts.append(_text((12.0, 22.0), title, "soft", 13, "start"))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {at.width:.0f} {at.height:.0f}" '
        f'width="{at.width:.0f}" height="{at.height:.0f}" font-family="system-ui,sans-serif" role="img">\n'
        f"<title>{svg_text(title or _summary(plan))}</title>\n<style>{_STYLE}</style>\n"
        f'<rect class="paper" width="100%" height="100%"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def _summary(plan: Plan) -> str:
    doors = (
        f"{door.label or 'door'} {STATE_WORDS[door.state]}, {door.distance_m:.2f} m" for door in plan.doors
    )
    return "; ".join(doors) or "no door"


def _view(plan: Plan, at: _Canvas) -> Iterator[str]:
    arc = _view_arc(plan)
    if not arc:
        return
    yield f'<polygon class="view" points="{" ".join(map(at, [(0.0, 0.0), *arc]))}"/>'
    for end in (arc[0], arc[-1]):
        yield _line((0.0, 0.0), end, at, "edge", 1)


def _view_arc(plan: Plan) -> list[Place]:
    """Return places at the end of the view, beyond the farthest door."""
    if plan.view_deg is None:
        return []
    reach_m = max((door.distance_m for door in plan.doors), default=2.0) + _VIEW_M
    right, left = (math.radians(angle) for angle in plan.view_deg)
    steps = [right + (left - right) * step / 16 for step in range(17)]
    return [(reach_m * math.cos(angle), reach_m * math.sin(angle)) for angle in steps]


def _door(door: PlanDoor, at: _Canvas) -> Iterator[str]:
    color = STATE_COLORS.get(door.state, "#7C828C")
    x, y = door.outward
    for end_x, end_y in (door.left_m, door.right_m):
        yield _line((end_x - 0.07 * x, end_y - 0.07 * y), (end_x + 0.07 * x, end_y + 0.07 * y), at, "jamb", 3)
    if door.hinge_m is None or door.tip_m is None:
        dash = "" if door.state in STATE_COLORS else ' stroke-dasharray="5 5"'
        first, last = at.pixel(door.left_m), at.pixel(door.right_m)
        yield _stroke(first, last, f'stroke="{color}" stroke-width="4"{dash}')
        return
    points = " ".join(map(at, (door.hinge_m, *door.swing_m)))
    yield f'<polygon points="{points}" fill="{color}" fill-opacity=".12"/>'
    arc = " ".join(map(at, door.swing_m))
    yield f'<polyline points="{arc}" fill="none" stroke="{color}" stroke-width="1.3" stroke-dasharray="4 4"/>'
    yield _stroke(at.pixel(door.hinge_m), at.pixel(door.tip_m), f'stroke="{color}" stroke-width="6"')
    u, v = at.pixel(door.hinge_m)
    yield f'<circle cx="{u:.1f}" cy="{v:.1f}" r="4.5" class="ink"/>'


def _distance(door: PlanDoor, at: _Canvas) -> Iterator[str]:
    x, y = door.middle_m
    yield _line(
        (0.28 * x / max(0.3, door.distance_m), 0.28 * y / max(0.3, door.distance_m)),
        (x, y),
        at,
        "ray",
        1,
        "2 4",
    )


def _door_text(door: PlanDoor, at: _Canvas) -> Iterator[str]:
    x, y = door.middle_m
    out_x, out_y = door.outward
    u, v = at.pixel((x + _LABEL_M * out_x, y + _LABEL_M * out_y))
    anchor = "middle" if abs(out_y) < 0.5 else "end" if out_y > 0 else "start"
    lift = -20.0 if anchor == "middle" else 0.0
    yield _text((u, v + lift), door.label or STATE_WORDS[door.state], "ink", 15, anchor, 650)
    words = [STATE_WORDS[door.state]] if door.label else []
    if door.angle_deg is not None and door.state != "closed":
        words.append(f"{door.angle_deg:.0f}°")
    if words:
        yield _text((u, v + lift + 17), " ".join(words), "soft", 13, anchor)
    share = 0.55
    yield _text(at.pixel((share * x, share * y)), f"{door.distance_m:.2f} m", "soft", 12, "middle")


def _robot(at: _Canvas) -> Iterator[str]:
    body = ((0.22, 0.0), (-0.18, 0.17), (-0.1, 0.0), (-0.18, -0.17))
    yield f'<polygon class="robot" points="{" ".join(map(at, body))}"/>'


def _scale(at: _Canvas) -> Iterator[str]:
    u, v = at.width - 20 - at.px_per_m, at.height - 18
    yield f'<path class="ray" fill="none" stroke-width="1.5" d="M{u:.1f} {v - 4:.1f}v8m0 -4h{at.px_per_m:g}m0 -4v8"/>'
    yield _text((u + at.px_per_m / 2, v - 6), "1 m", "soft", 11, "middle")


def _line(start: Place, end: Place, at: _Canvas, name: str, width: float, dash: str = "") -> str:
    more = f' stroke-dasharray="{dash}"' if dash else ""
    return _stroke(at.pixel(start), at.pixel(end), f'class="{name}" stroke-width="{width:g}"{more}')


def _stroke(start: tuple[float, float], end: tuple[float, float], style: str) -> str:
    (u, v), (end_u, end_v) = start, end
    return (
        f'<line x1="{u:.1f}" y1="{v:.1f}" x2="{end_u:.1f}" y2="{end_v:.1f}" stroke-linecap="round" {style}/>'
    )


def _text(place: tuple[float, float], text: str, name: str, size: int, anchor: str, weight: int = 400) -> str:
    u, v = place
    halo = 'paint-order="stroke" stroke-width="4" stroke-linejoin="round"'
    return (
        f'<text x="{u:.1f}" y="{v:.1f}" class="{name} halo" font-size="{size}" font-weight="{weight}" '
        f'text-anchor="{anchor}" dominant-baseline="middle" {halo}>{svg_text(text)}</text>'
    )
