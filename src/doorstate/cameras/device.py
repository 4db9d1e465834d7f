# SPDX-License-Identifier: Apache-2.0
"""Interface of a depth camera: open, frames, close. A vendor's software is imported when its camera is asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import (
    CameraError,
    CameraGoneError,
    ConfigError,
    DoorstateError,
    missing_extra,
    summarize_exception,
)
from doorstate.io.camera import Intrinsics

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class CameraRequest:
    """Camera and mode to open.

    Args:
        serial: serial number, or what else names one camera of a kind; empty for the first one.
        size: width and height of the depth image in pixels; None for what the camera chooses.
        fps: frames a second; None for what the camera chooses.
        recording: file recorded by the vendor's software, in place of an attached camera.
    """

    serial: str = ""
    size: tuple[int, int] | None = None
    fps: int | None = None
    recording: Path | None = None


class AttachedCamera(NamedTuple):
    """Camera that could be opened."""

    kind: str  # a name of `registry.CAMERAS`
    serial: str
    name: str


@dataclass(frozen=True, eq=False)
class DepthFrame:
    """Depth image of a camera, with all that its points follow from.

    Attributes:
        depth: (H, W) uint16 or float32 depth along the viewing axis, zero or NaN where nothing was measured; a copy.
        depth_scale_m: metres per unit of depth.
        intrinsics: camera of the image.
        captured_s: time of the image by `clock.steady_s`; of its arrival where the camera does not tell.
        number: count of the camera; the same number again is the same image.
        up: unit vector against gravity in the optical frame (x right, y down, z forward); None without accelerometer.
    """

    depth: NDArray[Any]
    depth_scale_m: float
    intrinsics: Intrinsics
    captured_s: float
    number: int
    up: Vector | None = None


class DepthCameraDevice(ABC):
    """Depth camera of one kind. Methods are called by one thread at a time."""

    kind: ClassVar[str]

    @abstractmethod
    def list_attached(self) -> list[AttachedCamera]:
        """Return the cameras that are attached now."""

    @abstractmethod
    def open(self, request: CameraRequest) -> str:
        """Start the camera, and return its name with its serial number.

        Raises:
            CameraGoneError: no such camera is attached, or it cannot be started now.
            CameraError: it has no such mode.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> DepthFrame | None:
        """Return the newest frame that was not returned yet, or None if none comes in time.

        Raises:
            CameraGoneError: the camera was unplugged, or its recording has ended.
        """

    @abstractmethod
    def close(self) -> None:
        """Stop the camera; it may be opened again. Closing twice does nothing."""


def load_sdk(module: str, kind: str) -> Any:
    """Import the software of a vendor; the extra of a camera has the name of its kind.

    Raises:
        MissingExtraError: it is not installed.
        CameraError: it is installed, and cannot be loaded.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise _not_loaded(module, error) from error
        raise missing_extra(f"the camera {kind}", kind) from error
    except (ImportError, OSError) as error:
        raise _not_loaded(module, error) from error


def _not_loaded(module: str, error: Exception) -> CameraError:
    return CameraError(
        f"{module} is installed, and cannot be loaded ({summarize_exception(error)})",
        hint="install the library of the system that it names",
    )


@contextmanager
def sdk_errors(problem: str) -> Iterator[None]:
    """Turn exceptions of a vendor's software, of any type, into one of a camera that is gone.

    Raises:
        CameraGoneError: the software raised an exception.
    """
    try:
        yield
    except DoorstateError:
        raise
    except Exception as error:
        raise CameraGoneError(f"{problem} ({summarize_exception(error)})") from error


def close_all(*functions: Callable[[], object] | None) -> None:
    """Call functions that close something; those of a camera that was unplugged raise exceptions of any type."""
    for function in functions:
        with suppress(Exception):
            if function is not None:
                function()


def not_attached(kind: str, serial: str) -> CameraGoneError:
    """Return the error of a camera that is not there."""
    name = f"the {kind} camera {serial}" if serial else f"a {kind} camera"
    return CameraGoneError(f"{name} is not attached, or another program uses it")


def no_mode(request: CameraRequest) -> CameraError:
    """Return the error of a size or rate that a camera does not have."""
    size = "any size" if request.size is None else f"{request.size[0]} x {request.size[1]} pixels"
    rate = "any rate" if request.fps is None else f"{request.fps} frames a second"
    return CameraError(f"the camera has no depth images of {size} at {rate}", field="size")


def no_recordings(kind: str) -> ConfigError:
    """Return the error of a camera whose software plays no recordings."""
    return ConfigError(f"the software of {kind} cameras plays no recordings", field="recording")


def rotation_or_none(rows: Any) -> NDArray[np.float64] | None:
    """Return (3, 3) numbers as a rotation; None if they are none, as of a camera that was not calibrated."""
    matrix = np.asarray(rows, np.float64)
    matrix = matrix.reshape(3, 3) if matrix.size == 9 else matrix
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        return None
    is_rotation = np.allclose(matrix @ matrix.T, np.eye(3), atol=0.02) and np.linalg.det(matrix) > 0
    return matrix if is_rotation else None
