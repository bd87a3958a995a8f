"""The picture that explains the product: the character in four states above, the bar with and without refit joints
below.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from .figures import Figure
from .placing import Slot, fitting_scale, place, seen_height
from .sheet import GREY, WIDTH, Card, compose, fade_foot, save_png
from .studio import QUICK, Quality, Studio

TOP, BOTTOM = 6.2, 3.2
ROOM = 1.73  # of a row of figures: title above, captions below
BAR_TURN = Matrix.Rotation(np.radians(-14.0), 4, "Z")
TITLE = "Cage Rig"
SUBTITLE = "One character, a cage and an armature.  Edit either one: the other follows, in rest and in pose."


def draw_picture(path: Path, characters: Sequence[Figure], bars: Sequence[Figure], *, quick: bool, yaw: float) -> None:
    """Render the picture to `path`.

    `bars`: six, three without and three with refit joints, or none; `yaw` in radians.
    """
    quality = QUICK if quick else Quality()
    panels = [_character_panel(characters, yaw, most=TOP if bars else TOP + 0.6)]
    if bars:
        panels.append(_bar_panel(bars))
    images = [panel.render(path.with_name(f"panel-{k}.png"), quality) for k, panel in enumerate(panels)]
    for panel in panels:
        bpy.data.scenes.remove(panel.scene)
    unit = images[0].shape[1] / WIDTH
    fade_foot(images[0], 0.15 * unit)
    low, high = images[0].shape[0], sum(image.shape[0] for image in images) - 0.18 * unit
    columns = ((0.3, 7.85), (8.15, 15.7)) if bars else ()
    save_png(path, compose(images, [Card((low, high), (x0 * unit, x1 * unit), 0.16 * unit) for x0, x1 in columns]))


def _character_panel(figures: Sequence[Figure], yaw: float, *, most: float) -> Studio:
    """The row of figures under the title, as high as they need but at most `most` units."""
    width = WIDTH / len(figures)
    turn = Matrix.Rotation(yaw, 4, "Z")
    scale = min(fitting_scale(figure, turn, width=width - 0.30, height=most - ROOM) for figure in figures)
    height = ROOM + scale * max(seen_height(figure, turn) for figure in figures)
    studio = Studio("Characters", width=WIDTH, height=max(height, 0.5 * most))
    top = 0.5 * studio.height
    studio.add_label(TITLE, x=-7.45, y=top - 0.52, size=0.50, align="LEFT")
    studio.add_label(SUBTITLE, x=-5.05, y=top - 0.55, size=0.25, color=GREY, align="LEFT")
    floor = -top + 0.78
    for k, figure in enumerate(figures):
        x = (k + 0.5 - 0.5 * len(figures)) * width
        place(studio, figure, turn, slot=Slot(x, floor), scale=scale)
        studio.add_label(figure.title, x=x, y=-top + 0.30, size=0.26)
    studio.add_floor(height=studio.on_plane(0.0, floor).z)
    return studio


def _bar_panel(figures: Sequence[Figure]) -> Studio:
    studio = Studio("Bars", width=WIDTH, height=BOTTOM)
    top = 0.5 * BOTTOM
    floor = -top + 0.62
    count = len(figures) // 2
    slot_width = 0.5 * (WIDTH - 1.2) / count
    scale = min(fitting_scale(figure, BAR_TURN, width=slot_width - 0.32, height=1.75) for figure in figures)
    for k, figure in enumerate(figures):
        group = k // count
        x = (-1 if group == 0 else 1) * 0.5 * (WIDTH - 0.3) / 2 + (k % count - 0.5 * (count - 1)) * slot_width
        place(studio, figure, BAR_TURN, slot=Slot(x, floor), scale=scale)
        studio.add_label(figure.title, x=x, y=-top + 0.36, size=0.20, color=GREY)
    left, right = -7.45, 0.35
    for x, heading, text in (
        (left, "Without SkelUp", "the cage is stretched, the joint stays behind"),
        (right, "With SkelUp", "the joint follows the cage"),
    ):
        studio.add_label(heading, x=x, y=top - 0.34, size=0.25, align="LEFT")
        offset = 2.25 if x == left else 1.80
        studio.add_label(text, x=x + offset, y=top - 0.35, size=0.20, color=GREY, align="LEFT")
    studio.add_floor(height=studio.on_plane(0.0, floor).z)
    return studio
