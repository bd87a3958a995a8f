# SPDX-License-Identifier: GPL-3.0-or-later
"""The legend in the lower right corner of the 3D View: bars of colours with numbers, and what to do to see more."""

from __future__ import annotations

from dataclasses import dataclass

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from . import colours

WIDTH, BAR, PAD, GAP, TEXT, MARGIN = 170.0, 9.0, 9.0, 6.0, 11.0, 12.0  # in units of the interface
BACK = (0.09, 0.09, 0.09, 0.78)
ALARM = (1.0, 0.62, 0.55)
FONT = 0


@dataclass(frozen=True)
class Entry:
    """One bar: what the weights are of, the smallest and the largest one; 0 is between them."""

    label: str
    low: float
    high: float


def entry(label: str, low: float, high: float) -> Entry:
    """What is lost in the noise is left out."""
    least = 2e-3 * max(-low, high)
    return Entry(label, low if -low > least else 0.0, high if high > least else 0.0)


def number(weight: float) -> str:
    """A weight in few characters."""
    return "0" if weight == 0.0 else f"{weight:.2g}" if abs(weight) < 0.0095 else f"{weight:.2f}"


def shades(entry: Entry, steps: int = 48) -> np.ndarray:
    """Colours along the bar, `#steps + 1 by 4`."""
    largest = max(abs(entry.low), abs(entry.high))
    return colours.of_weights(np.linspace(entry.low, entry.high, steps + 1), largest)


def corner(context: bpy.types.Context) -> tuple[float, float]:
    """Where the free part of the view ends on the right and below: sidebar and shelves may lie over it."""
    region = context.region
    right, bottom = region.width, 0
    for other in context.area.regions:
        left, low = other.x - region.x, other.y - region.y
        if other == region or other.width <= 1 or other.height <= 1:
            continue
        if other.type == "UI" and left > region.width / 2:
            right = min(right, left)
        if other.type in {"ASSET_SHELF", "ASSET_SHELF_HEADER"} and low < region.height / 2:
            bottom = max(bottom, low + other.height)
    return float(right), float(bottom)


def draw(context: bpy.types.Context, entries: list[Entry | str]) -> None:
    """Draw them above one another, where there is room."""
    unit = context.preferences.system.ui_scale
    right, bottom = corner(context)
    right, bottom = right - MARGIN * unit, bottom + MARGIN * unit
    if right < (WIDTH + MARGIN) * unit:
        return
    blf.size(FONT, TEXT * unit)
    blf.color(FONT, 0.93, 0.93, 0.93, 1.0)
    for entry in entries:
        draw_one = _draw_text if isinstance(entry, str) else _draw_bar
        bottom += draw_one(entry, right, bottom, unit) + GAP * unit


def words(context: bpy.types.Context, lines: list[str], *, alarm: bool) -> None:
    """Lines of text in the lower left corner, the first one in bold colour where something is wrong."""
    unit = context.preferences.system.ui_scale
    left = max((other.x - context.region.x + other.width for other in _on_the_left(context)), default=0)
    blf.size(FONT, TEXT * unit)
    width = max(_length(line) for line in lines) + 2 * PAD * unit
    step = (TEXT + GAP) * unit
    x, y = left + MARGIN * unit, _above_adjust(context) + MARGIN * unit
    _rectangle(x, y, width, len(lines) * step + 2 * PAD * unit - GAP * unit, BACK)
    for row, line in enumerate(reversed(lines)):
        blf.color(FONT, *(ALARM if alarm and row < len(lines) - 1 else (0.93, 0.93, 0.93)), 1.0)
        _text(line, x + PAD * unit, y + PAD * unit + row * step)


def _on_the_left(context: bpy.types.Context) -> list[bpy.types.Region]:
    """Regions that lie over the view's left side."""
    return [other for other in context.area.regions if other.type == "TOOLS" and other.width > 1]


def _above_adjust(context: bpy.types.Context) -> float:
    """The height over the panel Adjust Last Operation, where it is shown."""
    panels = [other for other in context.area.regions if other.type == "HUD" and other.height > 1]
    return max((other.y - context.region.y + other.height for other in panels), default=0)


def _draw_text(text: str, right: float, bottom: float, unit: float) -> float:
    width, height = _length(text) + 2 * PAD * unit, (2 * PAD + TEXT) * unit
    _rectangle(right - width, bottom, width, height, BACK)
    _text(text, right - width + PAD * unit, bottom + PAD * unit)
    return height


def _draw_bar(entry: Entry, right: float, bottom: float, unit: float) -> float:
    left, height = right - WIDTH * unit, (2 * PAD + 2 * TEXT + BAR + 2 * GAP) * unit
    _rectangle(left, bottom, WIDTH * unit, height, BACK)
    inner, width = left + PAD * unit, (WIDTH - 2 * PAD) * unit
    y = bottom + (PAD + TEXT + GAP) * unit
    _bar(entry, inner, y, width, BAR * unit)
    zero = (0.0 - entry.low) / (entry.high - entry.low) if entry.high > entry.low else 0.0
    low = bottom + PAD * unit
    if entry.low == entry.high:
        _text("moves nothing", inner, low)
    else:
        _text(number(entry.low), inner, low)
        _text(number(entry.high), inner + width - _length(number(entry.high)), low)
        if 0.2 < zero < 0.8:
            _text("0", inner + zero * width - 0.5 * _length("0"), low)
    _text(_fitted(entry.label, width), inner, y + (BAR + GAP) * unit)
    return height


def _fitted(label: str, width: float) -> str:
    while _length(label) > width and len(label) > 4:
        label = label[:-2].rstrip("…") + "…"
    return label


def _length(text: str) -> float:
    return float(blf.dimensions(FONT, text)[0])


def _text(text: str, x: float, y: float) -> None:
    blf.position(FONT, round(x), round(y), 0)
    blf.draw(FONT, text)


def _rectangle(x: float, y: float, width: float, height: float, colour: colours.Colour) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(x, y), (x + width, y), (x, y + height), (x + width, y + height)]
    shader.uniform_float("color", colour)
    gpu.state.blend_set("ALPHA")  # drawing text leaves it off
    batch_for_shader(shader, "TRI_STRIP", {"pos": corners}).draw(shader)


def _bar(entry: Entry, x: float, y: float, width: float, height: float) -> None:
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    table = shades(entry)
    along = x + np.linspace(0.0, width, len(table))
    low, high = np.full(len(table), y), np.full(len(table), y + height)
    points = np.stack([np.stack([along, low], 1), np.stack([along, high], 1)], 1).reshape(-1, 2)
    content = {"pos": points.astype(np.float32), "color": np.repeat(table, 2, axis=0)}
    batch_for_shader(shader, "TRI_STRIP", content).draw(shader)
