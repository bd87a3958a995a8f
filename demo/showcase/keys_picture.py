"""The picture of cage keys: each act as two strips of frames over a time line, by its bones alone and keyed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from .figures import Array
from .keys import Strip
from .placing import CAGE_BLUE, Slot, place
from .sheet import GREY, WIDTH, Card, compose, fade_foot, fade_sides, save_png
from .studio import QUICK, Quality, Studio
from .timeline import BONE_GREY, Ruler, add_frames, add_lane, add_stretch

HEAD, ROW, SHEET, FOOT, GAP = 1.14, 2.62, 2.86, 0.10, 0.16
GUTTER, COLUMN = -7.45, 2.24  # left of the words; from frame to frame
FIRST = -4.72  # the middle of the first frame
SCALE, KEY_SCALE = 1.22, 0.82  # units a metre
KEY_TURN = -25.0
TITLE = "Keys for the cage, beside an action"
SUBTITLE = "The bones' keys are not touched.  Between its own keys the cage moves linearly."
FLOOR = 0.20


@dataclass(frozen=True)
class Words:
    """A heading for each row, and lines under it; the names of the cage keys; how far figures are moved (units)."""

    plain: Sequence[str]
    keyed: Sequence[str]
    keys: Sequence[str]
    shift: float = 0.0


WORDS = {
    "Punch": Words(
        ("A punch", "by its bones", "alone"),
        ("…enriched", "by three keys", "of its cage"),
        ("as bound", "arm stretched, fist enlarged", "as bound"),
        shift=-0.22,
    ),
    "Walk": Words(
        ("A walk", "by its bones", "alone"),
        ("…fattened", "by four keys", "of its cage"),
        ("as bound", "stout", "fat", "as bound"),
    ),
}


def draw_keys(path: Path, strips: Sequence[Strip], *, quick: bool) -> None:
    """Render the picture to `path`."""
    quality = replace(QUICK, samples=2) if quick else Quality(samples=4)
    scratch = path.with_name("panel.png")
    images, cards = [_rendered(_head_panel(), scratch, quality)], []
    unit = images[0].shape[1] / WIDTH
    for strip in strips:
        start = sum(image.shape[0] for image in images)
        for panel in (_row(strip, keyed=False), _row(strip, keyed=True), _sheet(strip)):
            image = _rendered(panel, scratch, quality)
            fade_foot(image, 0.10 * unit)
            fade_sides(image, 0.6 * unit)
            images.append(image)
        end = sum(image.shape[0] for image in images)
        cards.append(Card((start + 0.5 * GAP * unit, end - 0.5 * GAP * unit), (0.3 * unit, 15.7 * unit), 0.16 * unit))
    foot = np.ones((round(FOOT * unit), *images[0].shape[1:]))
    save_png(path, compose([*images, foot], cards))


def _rendered(studio: Studio, scratch: Path, quality: Quality) -> Array:
    pixels = studio.render(scratch, quality)
    bpy.data.scenes.remove(studio.scene)
    return pixels


def _head_panel() -> Studio:
    studio = Studio("Head", width=WIDTH, height=HEAD)
    studio.add_label(TITLE, x=GUTTER, y=0.02, size=0.44, align="LEFT")
    studio.add_label(SUBTITLE, x=0.55, y=-0.015, size=0.21, color=GREY, align="LEFT")
    studio.add_floor(height=studio.on_plane(0.0, -2.0 * HEAD).z)
    return studio


def _row(strip: Strip, *, keyed: bool) -> Studio:
    """A strip of frames with its words."""
    studio = Studio(f"{strip.act.name} row", width=WIDTH, height=ROW)
    words, top = WORDS[strip.act.name], 0.5 * ROW
    origin = (strip.act.rig if keyed else strip.act.plain).armature.matrix_world.translation
    for k, figure in enumerate(strip.keyed if keyed else strip.plain):
        slot = Slot(FIRST + k * COLUMN + words.shift, FLOOR - top)
        place(studio, figure, Matrix(), slot=slot, scale=SCALE, origin=origin)
    heading, *notes = words.keyed if keyed else words.plain
    studio.add_label(heading, x=GUTTER, y=top - 0.50, size=0.32, align="LEFT")
    for k, note in enumerate(notes):
        studio.add_label(note, x=GUTTER, y=top - 0.88 - 0.26 * k, size=0.20, color=GREY, align="LEFT")
    studio.add_floor(height=studio.on_plane(0.0, FLOOR - top).z)
    return studio


def _sheet(strip: Strip) -> Studio:
    """The time line, with the cage keys under it."""
    studio = Studio(f"{strip.act.name} sheet", width=WIDTH, height=SHEET)
    floor = 0.44 - 0.5 * SHEET
    ruler = _add_lines(studio, strip, y=0.5 * SHEET - 0.16)
    matrix = strip.act.rig.armature.matrix_world
    turn = Matrix.Rotation(np.radians(KEY_TURN), 4, "Z") @ matrix.to_3x3().to_4x4().inverted()
    names = WORDS[strip.act.name].keys
    for key, figure, name in zip(strip.act.cage_keys(), strip.keys, names, strict=True):
        slot = Slot(ruler.at(key), floor)
        place(studio, figure, turn, slot=slot, scale=KEY_SCALE, origin=turn @ matrix.translation, line=0.6)
        studio.add_label(name, x=ruler.at(key), y=floor - 0.20, size=0.18, color=CAGE_BLUE)
    for k, note in enumerate(("the cage keys,", "in the rest pose")):
        studio.add_label(note, x=GUTTER, y=floor + 1.0 - 0.26 * k, size=0.20, color=GREY, align="LEFT")
    studio.add_floor(height=studio.on_plane(0.0, floor).z)
    return studio


def _add_lines(studio: Studio, strip: Strip, *, y: float) -> Ruler:
    """The lanes; `y` of the frames' numbers. Returns where frames are."""
    act = strip.act
    pitch = COLUMN / (act.shown[1] - act.shown[0])
    margin = 0.44 * COLUMN / pitch
    ruler = Ruler(FIRST - pitch * act.shown[0], pitch, (act.shown[0] - margin, act.shown[-1] + margin))
    bones, cage = y - 0.27, y - 0.57
    bone_keys = [frame for frame in act.bone_keys() if ruler.span[0] <= frame <= ruler.span[1]]
    studio.add_label("frame", x=GUTTER, y=y, size=0.18, color=GREY, align="LEFT")
    add_frames(studio, ruler, act.shown, y=y, foot=cage, size=0.18)
    for name, keys, at, color in (("bones", bone_keys, bones, BONE_GREY), ("cage", act.cage_keys(), cage, CAGE_BLUE)):
        studio.add_label(name, x=GUTTER, y=at, size=0.19, color=color, align="LEFT")
        add_lane(studio, ruler, keys, y=at, color=color, size=0.085)
    add_stretch(studio, ruler, act.cage_keys(), y=cage)
    return ruler
