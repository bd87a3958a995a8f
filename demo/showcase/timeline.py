"""A dope sheet of two lanes in a studio's picture plane: where bones are keyed, and where the cage is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from .placing import add_lines
from .sheet import GREY
from .studio import Studio, flat_material

BONE_GREY = (0.16, 0.18, 0.22)
LINE = (0.62, 0.66, 0.72)
DEPTH = 18.0  # toward the camera, behind labels


@dataclass(frozen=True)
class Ruler:
    """Where frames are on a panel: `x` of frame 0 and units a frame; `span`, the first and last frame."""

    x: float
    pitch: float
    span: tuple[float, float]

    def at(self, frame: float) -> float:
        return self.x + self.pitch * frame


def add_lane(
    studio: Studio,
    ruler: Ruler,
    keys: Sequence[float],
    *,
    y: float,
    color: tuple[float, ...],
    size: float,
) -> None:
    """A line over the ruler's span with a diamond at each key; `size`: of a diamond's half width, in units."""
    first, last = (ruler.at(frame) for frame in ruler.span)
    _add(studio, "Lane", [_box(0.5 * (first + last), y, 0.5 * (last - first), 0.008)], LINE, depth=DEPTH)
    _add(studio, "Keys", [_diamond(ruler.at(frame), y, size) for frame in keys], color, depth=DEPTH + 0.5)


def add_stretch(studio: Studio, ruler: Ruler, keys: Sequence[float], *, y: float) -> None:
    """A thicker line from the first key to the last: between them the cage moves."""
    first, last = ruler.at(keys[0]), ruler.at(keys[-1])
    box = _box(0.5 * (first + last), y, 0.5 * (last - first), 0.022)
    _add(studio, "Stretch", [box], (0.22, 0.42, 0.86), depth=DEPTH + 0.2)


def add_frames(studio: Studio, ruler: Ruler, frames: Sequence[int], *, y: float, foot: float, size: float) -> None:
    """A number at each of `frames`, and a thin line from it down to `foot`."""
    for frame in frames:
        studio.add_label(f"{frame}", x=ruler.at(frame), y=y, size=size, color=GREY)
    top = y - 0.75 * size
    boxes = [_box(ruler.at(frame), 0.5 * (top + foot), 0.006, 0.5 * (top - foot)) for frame in frames]
    _add(studio, "Frames", boxes, LINE, depth=DEPTH - 0.5)


def _box(x: float, y: float, half_width: float, half_height: float) -> list[tuple[float, float]]:
    return [(x + a * half_width, y + b * half_height) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def _diamond(x: float, y: float, half: float) -> list[tuple[float, float]]:
    return [(x + a * half, y + b * half) for a, b in ((0, -1), (1, 0), (0, 1), (-1, 0))]


def _add(
    studio: Studio,
    name: str,
    corners: Sequence[Sequence[tuple[float, float]]],
    color: tuple[float, ...],
    *,
    depth: float,
) -> bpy.types.Object:
    points = np.array([studio.on_plane(x, y, depth=depth) for quad in corners for x, y in quad])
    quads = np.arange(len(points)).reshape(-1, 4)
    return add_lines(studio, name, points, quads, surface=flat_material(f"{name} {color}", color))
