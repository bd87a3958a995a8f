# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of weights, and of the figures.

Weights get a ramp whose lightness grows evenly with them in OKLCH, so that equal steps of weight look like equal steps:
from violet over blue and green to yellow for positive weights, from violet over red to pink for negative ones. Weights
near 0 are transparent: there the skin keeps its own look.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Colour = tuple[float, float, float, float]
Colours = NDArray[np.float32]

STEPS = 256  # on either side of 0
SOLID = 0.12  # the share of the largest weight from which on a weight is fully coloured
# lightness, chroma, hue in degrees at evenly spaced weights from 0 to the largest
POSITIVE = ((0.36, 0.13, 303.0), (0.49, 0.12, 262.0), (0.62, 0.10, 205.0), (0.76, 0.14, 155.0), (0.92, 0.18, 107.0))
NEGATIVE = ((0.36, 0.13, -57.0), (0.50, 0.17, -15.0), (0.64, 0.18, 5.0), (0.79, 0.11, 10.0))

REST_CAGE: Colour = (1.0, 0.63, 0.20, 1.0)
POSED_CAGE: Colour = (0.36, 0.72, 1.0, 1.0)
REFIT: Colour = (0.20, 0.86, 0.66, 1.0)
ORIGINAL: Colour = (0.80, 0.80, 0.80, 0.5)
APART: Colour = (1.0, 0.45, 0.35, 0.9)
ANCHOR: Colour = (1.0, 1.0, 1.0, 1.0)


def _ramp(stops: tuple[tuple[float, float, float], ...]) -> Colours:
    at, grid = np.linspace(0.0, 1.0, len(stops)), np.linspace(0.0, 1.0, STEPS + 1)
    lightness, chroma, hue = (np.interp(grid, at, column) for column in np.transpose(stops))
    return _srgb(lightness, chroma, np.radians(hue))


def _srgb(lightness: NDArray[np.float64], chroma: NDArray[np.float64], hue: NDArray[np.float64]) -> Colours:
    """OKLCH to sRGB, each channel 0 to 1 (Ottosson 2020)."""
    a, b = chroma * np.cos(hue), chroma * np.sin(hue)
    cones = np.stack(
        [
            lightness + 0.3963377774 * a + 0.2158037573 * b,
            lightness - 0.1055613458 * a - 0.0638541728 * b,
            lightness - 0.0894841775 * a - 1.2914855480 * b,
        ]
    )
    linear = (
        np.array(
            [
                [4.0767416621, -3.3077115913, 0.2309699292],
                [-1.2684380046, 2.6097574011, -0.3413193965],
                [-0.0041960863, -0.7034186147, 1.7076147010],
            ]
        )
        @ cones**3
    ).clip(0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return encoded.T.astype(np.float32)


def _table() -> Colours:
    positive, negative = _ramp(POSITIVE), _ramp(NEGATIVE)
    table = np.ones((2 * STEPS + 1, 4), np.float32)
    table[:, :3] = np.concatenate([negative[:0:-1], positive])
    share = np.abs(np.linspace(-1.0, 1.0, 2 * STEPS + 1)) / SOLID
    table[:, 3] = np.clip(share, 0.0, 1.0) ** 1.5
    return table


TABLE = _table()  # colours of weights from -1 to 1


def of_weights(weights: NDArray[np.floating], largest: float, opacity: float = 1.0) -> Colours:
    """Colours `#weights by 4` on the scale from -`largest` over 0 to `largest`."""
    step = np.float32(STEPS / largest if largest > 0.0 else 0.0)
    index = np.rint(weights * step).astype(np.int32)
    np.clip(index, -STEPS, STEPS, out=index)
    table = TABLE * np.float32([1.0, 1.0, 1.0, opacity])
    return table[index + STEPS]
