"""The picture of the skinning methods: a row each, the arm at rest, bent, its elbow from near, and reshaped."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import drawing
from .elbow import Elbow
from .figures import Array
from .methods import MethodRow
from .placing import Slot, add_lines, place
from .sheet import GREY, WIDTH, Card, compose, fade_foot, fade_sides, inset, save_png
from .studio import INK, QUICK, Quality, Studio, attribute_material, flat_material, view_direction

HEAD, ROW, FOOT, GAP = 1.92, 3.0, 0.10, 0.16
TURN = Matrix.Rotation(np.radians(-9.0), 4, "Z")
SCALE, CLOSE_SCALE = 5.0, 10.4  # units a metre
CLOSE_RADIUS = 1.32
FLOOR, HOVER = 0.25, 0.16
TITLE = "One arm, three ways to bend it"
SUBTITLE = "The same bones, weights and cage under each skinning method."
COLUMNS = (  # the middle of each, and what is written under its caption
    (-5.32, "with its cage"),
    (-1.27, "the posed cage follows"),
    (1.92, "dashed: as at rest;  blue: thinner,  red: thicker"),
    (5.56, "longer and stouter, in the same pose"),
)
CLOSE_UP = 2  # the column
CLAY, THIN, THICK = (0.47, 0.44, 0.41), (0.02, 0.12, 0.70), (0.75, 0.02, 0.04)
FULL_TINT = 0.28  # of the radius


def draw_methods(path: Path, rows: Sequence[MethodRow], *, quick: bool) -> None:
    """Render the picture to `path`."""
    quality = QUICK if quick else Quality(samples=5)
    scratch = path.with_name("panel.png")
    images = [_rendered(_head_panel(rows[0]), scratch, quality), *(_row_image(row, scratch, quality) for row in rows)]
    unit = images[0].shape[1] / WIDTH
    ends = np.cumsum([image.shape[0] for image in images])
    cards = [
        Card((low + 0.5 * GAP * unit, high - 0.5 * GAP * unit), (0.3 * unit, 15.7 * unit), 0.16 * unit)
        for low, high in pairwise(ends)
    ]
    foot = np.ones((round(FOOT * unit), *images[0].shape[1:]))
    save_png(path, compose([*images, foot], cards))


def _rendered(studio: Studio, scratch: Path, quality: Quality) -> Array:
    """The pixels of a panel, whose scene is done with."""
    pixels = studio.render(scratch, quality)
    bpy.data.scenes.remove(studio.scene)
    return pixels


def _row_image(row: MethodRow, scratch: Path, quality: Quality) -> Array:
    """A row with its close-up laid in."""
    image = _rendered(_row_panel(row), scratch, quality)
    unit = image.shape[1] / WIDTH
    fade_foot(image, 0.10 * unit)
    fade_sides(image, 0.6 * unit)
    middle = ((COLUMNS[CLOSE_UP][0] + 0.5 * WIDTH) * unit, 0.5 * image.shape[0])
    inset(image, _rendered(_close_up(row), scratch, quality), middle, radius=CLOSE_RADIUS * unit)
    return image


def _head_panel(row: MethodRow) -> Studio:
    """The title, and a caption over each column."""
    studio = Studio("Head", width=WIDTH, height=HEAD)
    top = 0.5 * HEAD
    studio.add_label(TITLE, x=-7.45, y=top - 0.52, size=0.44, align="LEFT")
    studio.add_label(SUBTITLE, x=-0.9, y=top - 0.55, size=0.25, color=GREY, align="LEFT")
    captions = [figure.title for figure in row.figures]
    captions.insert(CLOSE_UP, "Close up")
    for (x, note), caption in zip(COLUMNS, captions, strict=True):
        studio.add_label(caption, x=x, y=-top + 0.50, size=0.26)
        studio.add_label(note, x=x, y=-top + 0.18, size=0.175, color=GREY)
    studio.add_floor(height=studio.on_plane(0.0, -2.0 * HEAD).z)
    return studio


def _row_panel(row: MethodRow) -> Studio:
    """The three figures of one method, with its name and what was measured."""
    studio = Studio(row.name, width=WIDTH, height=ROW)
    top = 0.5 * ROW
    floor = -top + FLOOR
    places = [x for k, (x, _) in enumerate(COLUMNS) if k != CLOSE_UP]
    for x, figure in zip(places, row.figures, strict=True):
        place(studio, figure, TURN, slot=Slot(x, floor, HOVER), scale=SCALE)
    studio.add_label(row.name, x=-7.45, y=top - 0.46, size=0.34, align="LEFT")
    for k, fact in enumerate(row.elbow.facts()):
        studio.add_label(fact, x=-7.45, y=top - 0.84 - 0.25 * k, size=0.185, color=GREY, align="LEFT")
    studio.add_floor(height=studio.on_plane(0.0, floor).z)
    return studio


def _close_up(row: MethodRow) -> Studio:
    """The elbow without its cage, tinted by its thickness, with the outline of an arm that keeps its own."""
    size = 2.0 * CLOSE_RADIUS + 0.1
    studio = Studio(f"{row.name} close up", width=size, height=size)
    look_at = Vector(row.elbow.joint) + Vector((0.022, 0.0, 0.022))
    matrix = Matrix.Scale(CLOSE_SCALE, 4) @ Matrix.Translation(-look_at)
    for mesh in row.figures[1].meshes:
        tinted = mesh.copy()
        _tint(tinted, row.elbow)
        studio.add_mesh(tinted, matrix=matrix)
    dashes = [[k, k + 1] for k in range(0, len(row.elbow.outline) - 1, 2)]
    vertices, faces = drawing.tubes(row.elbow.outline, dashes, radius=0.0011)
    toward = Matrix.Translation(-6.0 * view_direction())
    ink = flat_material("Outline", INK)
    add_lines(studio, "Outline", vertices, faces, surface=ink, matrix=toward @ matrix)
    studio.add_floor(height=studio.on_plane(0.0, -2.0 * size).z)
    return studio


def _tint(mesh: bpy.types.Mesh, elbow: Elbow) -> None:
    """Colour it blue where it is thinner than at rest and red where it is thicker."""
    change = (elbow.outer * np.clip((elbow.thickness - 1.0) / FULL_TINT, -1.0, 1.0))[:, None]
    colors = np.ones((len(change), 4), np.float32)
    colors[:, :3] = _mixed(_mixed(np.array(CLAY), THIN, np.maximum(-change, 0.0)), THICK, np.maximum(change, 0.0))
    attribute = mesh.attributes.new("Thickness", "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", colors.ravel())
    mesh.materials.clear()
    mesh.materials.append(attribute_material("Thickness", roughness=0.5))


def _mixed(first: Array, second: Sequence[float], share: Array) -> Array:
    return (1.0 - share) * first + share * np.array(second)
