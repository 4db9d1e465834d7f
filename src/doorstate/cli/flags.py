# SPDX-License-Identifier: Apache-2.0
"""Python parameters as flags of the command line, for error messages."""

from __future__ import annotations

# Flags that are not spelled like the parameter of the library function they are passed to.
_FLAGS = {
    "roll_deg": "--roll",
    "pitch_deg": "--pitch",
    "camera_height_m": "--camera-height",
    "depth_scale_m": "--depth-scale",
    "units_m": "--units",
    "num_points": "--points",
    "raw": "--keep",
    "recipe_changes": "--set",
    "dataset": "--data",
    "memory_bytes": "--memory-gib",
    "recording": "--play",
}


def format_flag(name: str, value: object = None) -> str:
    """Return a parameter as a user types it, such as `--points 128`; without a value only the flag."""
    if name == "units_m" and isinstance(value, float):
        from doorstate.io.options import unit_name

        value = unit_name(value)
    flag = _FLAGS.get(name, f"--{name.replace('_', '-')}")
    return flag if value is None or value is True else f"{flag} {value}"
