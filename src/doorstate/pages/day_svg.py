# SPDX-License-Identifier: Apache-2.0
"""States of doors over a day as an SVG picture: a bar for each time in which a door was seen in one state."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import datetime, timedelta, tzinfo

from doorstate.doors.intervals import StateInterval
from doorstate.pages.colors import STATE_COLORS, STATE_WORDS
from doorstate.pages.svg_text import svg_text

_WIDTH_PX, _ROW_PX, _BAR_PX = 960.0, 30.0, 16.0
_TOP_PX, _RIGHT_PX, _BOTTOM_PX = 48.0, 24.0, 34.0
_CHARACTER_PX, _LEAST_LEFT_PX, _MOST_LEFT_PX = 7.6, 70.0, 260.0
_TICK_H = 3
_LEAST_BAR_PX = 1.5  # a door that was seen for a moment is still shown
_STYLE = """
.paper{fill:#fff}.ink{fill:#1c1f24}.soft{fill:#5d6570}.track{fill:#eef0f3}.grid{stroke:#d4d8de}
@media (prefers-color-scheme:dark){.paper{fill:#16181c}.ink{fill:#eceef1}.soft{fill:#a7aeb8}
.track{fill:#262a30}.grid{stroke:#3b4149}}
"""


def day_bounds(day: datetime) -> tuple[float, float]:
    """Return the first second of a day and of the next, in the time zone of the day; some days have 23 or 25 hours."""
    start = day.replace(hour=0, minute=0, second=0, microsecond=0)
    return start.timestamp(), (start + timedelta(days=1)).timestamp()


def day_svg(intervals: Sequence[StateInterval], doors: Sequence[str], day: datetime) -> str:
    """Return the picture of a day; grey is a time in which a door was not seen.

    Args:
        intervals: times of states, of any day.
        doors: doors to show, one row each.
        day: any time of the day, with its time zone.
    """
    first_s, last_s = day_bounds(day)
    left_px = min(max(_LEAST_LEFT_PX, max(map(len, doors), default=0) * _CHARACTER_PX + 24), _MOST_LEFT_PX)
    height_px = _TOP_PX + _ROW_PX * len(doors) + _BOTTOM_PX
    scale = (_WIDTH_PX - left_px - _RIGHT_PX) / (last_s - first_s)

    def x_of(time_s: float) -> float:
        return left_px + (min(max(time_s, first_s), last_s) - first_s) * scale

    parts = [*_legend(), *_ticks(first_s, last_s, day.tzinfo, x_of, height_px)]
    for number, door in enumerate(doors):
        parts += _row(door, number, [one for one in intervals if one.door == door], (first_s, last_s), x_of)
    title = f"Doors on {day:%Y-%m-%d}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH_PX:.0f} {height_px:.0f}" '
        f'width="{_WIDTH_PX:.0f}" height="{height_px:.0f}" font-family="system-ui,sans-serif" role="img">\n'
        f"<title>{title}</title>\n<style>{_STYLE}</style>\n"
        f'<rect class="paper" width="100%" height="100%"/>\n'
        f'<text class="ink" x="12" y="27" font-size="15" font-weight="650">{title}</text>\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )


def _row(
    door: str,
    number: int,
    intervals: Sequence[StateInterval],
    day_s: tuple[float, float],
    x_of: Callable[[float], float],
) -> Iterator[str]:
    y = _TOP_PX + _ROW_PX * (number + 0.5)
    first, last = map(x_of, day_s)
    place = f'x="{first - 12:.1f}" y="{y + 4.5:.1f}"'
    yield f'<text class="ink" {place} font-size="13" text-anchor="end">{svg_text(door)}</text>'
    yield _bar(first, last, y, 'class="track"')
    for interval in intervals:
        if interval.last_s > day_s[0] and interval.first_s < day_s[1]:
            start = x_of(interval.first_s)
            end = max(x_of(interval.last_s), start + _LEAST_BAR_PX)
            yield _bar(start, end, y, f'fill="{STATE_COLORS.get(interval.state, "#7C828C")}"')


def _bar(start: float, end: float, y: float, style: str) -> str:
    return f'<rect x="{start:.2f}" y="{y - _BAR_PX / 2:.1f}" width="{end - start:.2f}" height="{_BAR_PX:g}" {style}/>'


def _ticks(
    first_s: float, last_s: float, zone: tzinfo | None, x_of: Callable[[float], float], height_px: float
) -> Iterator[str]:
    bottom = height_px - _BOTTOM_PX
    hours = round((last_s - first_s) / 3600)
    for hour in range(0, hours + 1, _TICK_H):
        time_s = first_s + 3600 * hour
        text = f"{datetime.fromtimestamp(time_s, zone):%H:%M}"
        x = x_of(time_s)
        yield f'<line class="grid" x1="{x:.1f}" y1="{_TOP_PX:g}" x2="{x:.1f}" y2="{bottom:g}"/>'
        yield f'<text class="soft" x="{x:.1f}" y="{bottom + 18:g}" font-size="12" text-anchor="middle">{text}</text>'


def _legend() -> Iterator[str]:
    x = _WIDTH_PX - _RIGHT_PX - 360
    for state, color in STATE_COLORS.items():
        yield f'<rect x="{x:.0f}" y="17" width="12" height="12" fill="{color}"/>'
        yield f'<text class="soft" x="{x + 18:.0f}" y="27.5" font-size="12">{STATE_WORDS[state]}</text>'
        x += 95
    yield f'<rect class="track" x="{x:.0f}" y="17" width="12" height="12"/>'
    yield f'<text class="soft" x="{x + 18:.0f}" y="27.5" font-size="12">not seen</text>'
