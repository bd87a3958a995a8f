"""Puts rendered panels together: a light backdrop, cards under the panels, round close-ups; writes the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

Array = np.ndarray

WIDTH = 16.0  # of a sheet, in units
GREY = (0.17, 0.19, 0.23)
RIM = (0.62, 0.66, 0.72)


@dataclass(frozen=True)
class Card:
    """A bright rounded rectangle under the panels, in pixels: `rows` from the top, `columns` from the left."""

    rows: tuple[float, float]
    columns: tuple[float, float]
    radius: float


def compose(images: Sequence[Array], cards: Sequence[Card]) -> Array:
    """Stack the panels and tint them by the backdrop with its cards (height by width by 3)."""
    height, width = sum(image.shape[0] for image in images), images[0].shape[1]
    fade = np.linspace(0.0, 1.0, height)[:, None, None]
    canvas = np.array([0.950, 0.957, 0.968]) * (1.0 - fade) + np.array([0.885, 0.900, 0.918]) * fade
    canvas = np.repeat(canvas, width, axis=1)
    for card in cards:
        cover = _coverage(canvas.shape, card)
        canvas += cover[..., None] * (np.array([0.99, 0.992, 0.996]) - canvas) * 0.85
    return canvas * np.concatenate(images)


def fade_foot(image: Array, rows: float) -> None:
    """Let a panel's shadows fade out over its last `rows` pixels."""
    count = max(1, round(rows))
    image[-count:] += (1.0 - image[-count:]) * np.linspace(0.0, 1.0, count)[:, None, None]


def fade_sides(image: Array, columns: float) -> None:
    """Let a panel's shadows fade out in `columns` pixels at its left and right: gone in the outer half of them."""
    count = max(1, round(columns))
    for side in (image[:, :count][:, ::-1], image[:, -count:]):
        side += (1.0 - side) * np.minimum(np.linspace(0.0, 2.0, count), 1.0)[:, None]


def inset(image: Array, close_up: Array, center: tuple[float, float], *, radius: float) -> None:
    """Lay the square `close_up` over `image` in a circle with a thin rim; `center` and `radius` in pixels, x and y."""
    left, top = (round(at - 0.5 * size) for at, size in zip(center, close_up.shape[1::-1], strict=True))
    under = image[top : top + close_up.shape[0], left : left + close_up.shape[1]]
    middle = (center[1] - top, center[0] - left)
    for reach, laid in ((radius, np.array(RIM)), (radius - max(1.0, 0.02 * radius), close_up)):
        rows, columns = ((at - reach, at + reach) for at in middle)
        cover = _coverage(under.shape, Card(rows, columns, reach))[..., None]
        under += cover * (laid - under)


def save_png(path: Path, pixels: Array) -> None:
    """Write display values (height by width by 3, top row first) as a PNG."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new(path.stem, width, height)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels[::-1]
    image.pixels.foreach_set(rgba.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


def _coverage(shape: tuple[int, ...], card: Card) -> Array:
    """How much of each pixel the card covers (height by width)."""
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    dx = np.abs(x - 0.5 * sum(card.columns)) - 0.5 * (card.columns[1] - card.columns[0]) + card.radius
    dy = np.abs(y - 0.5 * sum(card.rows)) - 0.5 * (card.rows[1] - card.rows[0]) + card.radius
    distance = np.hypot(np.maximum(dx, 0.0), np.maximum(dy, 0.0)) + np.minimum(np.maximum(dx, dy), 0.0) - card.radius
    return np.clip(0.5 - distance, 0.0, 1.0)
