# SPDX-License-Identifier: Apache-2.0
"""Sums over windows of pixels, and noise that is correlated over a window.

All by additions and comparisons of whole images in a fixed order, so processors give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
_BAND_ROWS = 32


def window_sum(padded: Image, size: int) -> Image:
    """Return the sums over all size x size windows of an image, (H - size + 1, W - size + 1)."""
    sums: Image = _in_bands(padded, size, np.add)
    return sums


def window_mean(image: Image, size: int) -> Image:
    """Return the mean of a square of odd size about each pixel; the border repeats itself."""
    mean = window_sum(np.pad(image, size // 2, mode="edge"), size)
    mean *= np.float32(1 / size**2)
    return mean


def widen(mask: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    """Return the pixels with a True pixel in a square of odd size about them."""
    wide: NDArray[np.bool_] = _in_bands(np.pad(mask, size // 2), size, np.logical_or)
    return wide


def correlated_noise(shape: tuple[int, ...], size: int, rng: np.random.Generator) -> Image:
    """Return normal noise of unit variance, averaged over windows as a matcher averages the errors of its pixels.

    The correlation falls linearly to 0 at a distance of `size` pixels along rows and columns.
    """
    height, width = shape
    white = rng.standard_normal((height + size - 1, width + size - 1), dtype=np.float32)
    noise = window_sum(white, size)
    noise *= np.float32(1 / size)
    return noise


def blobs(shape: tuple[int, ...], size: int, rng: np.random.Generator) -> Image:
    """Return smooth noise of about unit variance whose hills and hollows are about 2 `size` pixels wide."""
    height, width = shape
    white = rng.standard_normal((height // size + 4, width // size + 4), dtype=np.float32)
    # Sums of 2 x 2 have variance 4; interpolation between them leaves 5/6 of it along each axis.
    coarse = window_sum(white, 2) * np.float32(0.6)
    return enlarge(coarse, shape, size, rng.integers(0, size, 2).tolist())


def enlarge(coarse: Image, shape: tuple[int, ...], step: int, first: list[int]) -> Image:
    """Interpolate linearly between values `step` pixels apart; pixel (0, 0) lies `first` pixels after the first."""
    for axis, (length, start) in enumerate(zip(shape, first, strict=True)):
        place = np.arange(start, start + length)
        share = (place % step).astype(np.float32) / np.float32(step)
        below = np.minimum(place // step, coarse.shape[axis] - 1)
        above = np.minimum(below + 1, coarse.shape[axis] - 1)
        low, high = coarse.take(below, axis), coarse.take(above, axis)
        high -= low
        high *= share if axis else share[:, None]
        high += low
        coarse = high
    return coarse


def _in_bands(padded: Any, size: int, join: Callable[[Any, Any], Any]) -> Any:
    """Join the pixels of all windows, in bands of rows that stay in a processor's cache."""
    height, width = (length - size + 1 for length in padded.shape)
    joined = np.empty((height, width), padded.dtype)
    for top in range(0, height, _BAND_ROWS):
        band = padded[top : top + _BAND_ROWS + size - 1]
        joined[top : top + _BAND_ROWS] = _along(_along(band, size, join, 0), size, join, 1)
    return joined


def _along(image: Any, size: int, join: Callable[[Any, Any], Any], axis: int) -> Any:
    """Join `size` neighbours by joining pairs, pairs of pairs, and so on."""
    length = image.shape[axis] - size + 1
    whole = None
    offset, width, power = 0, 1, image
    while True:
        if size & width:
            part = _part(power, offset, offset + length, axis)
            whole = part if whole is None else join(whole, part)
            offset += width
        if 2 * width > size:
            return whole
        count = power.shape[axis]
        power = join(_part(power, 0, count - width, axis), _part(power, width, count, axis))
        width *= 2


def _part(image: Any, start: int, stop: int, axis: int) -> Any:
    return image[:, start:stop] if axis else image[start:stop]
