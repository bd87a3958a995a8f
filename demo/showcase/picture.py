"""The picture that explains the product: the character in four states above, the bar with and without refit joints
below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from blend_fixtures.materials import material

from . import drawing
from .figures import Figure, mesh_points, to_world
from .studio import Quality, Studio, flat_material, glass_material, view_direction

Array = np.ndarray

WIDTH, TOP, BOTTOM = 16.0, 6.2, 3.2
ROOM = 1.73  # of a row of figures: title above, captions below
CAGE_BLUE = (0.02, 0.16, 0.72)
GREY = (0.17, 0.19, 0.23)
BAR_TURN = Matrix.Rotation(np.radians(-14.0), 4, "Z")
TITLE = "Cage Rig"
SUBTITLE = "One character, a cage and an armature.  Edit either one: the other follows, in rest and in pose."


@dataclass(frozen=True)
class Slot:
    """A place on a panel, in units: the middle of its floor line."""

    x: float
    floor: float


def draw_picture(path: Path, characters: Sequence[Figure], bars: Sequence[Figure], *, quick: bool, yaw: float) -> None:
    """Render the picture to `path`.

    `bars`: six, three without and three with refit joints, or none; `yaw` in radians.
    """
    quality = Quality(scale=0.5, samples=5) if quick else Quality()
    panels = [_character_panel(characters, yaw, most=TOP if bars else TOP + 0.6)]
    if bars:
        panels.append(_bar_panel(bars))
    images = [panel.render(path.with_name(f"panel-{k}.png"), quality) for k, panel in enumerate(panels)]
    for panel in panels:
        bpy.data.scenes.remove(panel.scene)
    _save(path, _compose(images))


def _character_panel(figures: Sequence[Figure], yaw: float, *, most: float) -> Studio:
    """The row of figures under the title, as high as they need but at most `most` units."""
    width = WIDTH / len(figures)
    turn = Matrix.Rotation(yaw, 4, "Z")
    scale = min(_fitting_scale(figure, turn, width=width - 0.30, height=most - ROOM) for figure in figures)
    height = ROOM + scale * max(_seen_height(figure, turn) for figure in figures)
    studio = Studio("Characters", width=WIDTH, height=max(height, 0.5 * most))
    top = 0.5 * studio.height
    studio.add_label(TITLE, x=-7.45, y=top - 0.52, size=0.50, align="LEFT")
    studio.add_label(SUBTITLE, x=-5.05, y=top - 0.55, size=0.25, color=GREY, align="LEFT")
    floor = -top + 0.78
    for k, figure in enumerate(figures):
        x = (k + 0.5 - 0.5 * len(figures)) * width
        _place(studio, figure, turn, slot=Slot(x, floor), scale=scale)
        studio.add_label(figure.title, x=x, y=-top + 0.30, size=0.26)
    studio.add_floor(height=studio.on_plane(0.0, floor).z)
    return studio


def _bar_panel(figures: Sequence[Figure]) -> Studio:
    studio = Studio("Bars", width=WIDTH, height=BOTTOM)
    top = 0.5 * BOTTOM
    floor = -top + 0.62
    count = len(figures) // 2
    slot_width = 0.5 * (WIDTH - 1.2) / count
    scale = min(_fitting_scale(figure, BAR_TURN, width=slot_width - 0.32, height=1.75) for figure in figures)
    for k, figure in enumerate(figures):
        group = k // count
        x = (-1 if group == 0 else 1) * 0.5 * (WIDTH - 0.3) / 2 + (k % count - 0.5 * (count - 1)) * slot_width
        _place(studio, figure, BAR_TURN, slot=Slot(x, floor), scale=scale)
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


def _extent(figure: Figure, turn: Matrix) -> tuple[Array, Array]:
    points = figure.points() @ np.array(turn.to_3x3()).T
    return points.min(axis=0), points.max(axis=0)


def _fitting_scale(figure: Figure, turn: Matrix, *, width: float, height: float) -> float:
    low, high = _extent(figure, turn)
    return float(min(width / (high - low)[0], height / _seen_height(figure, turn)))


def _seen_height(figure: Figure, turn: Matrix) -> float:
    """How high the figure stands in the picture, in its own units; the camera looks down a little."""
    low, high = _extent(figure, turn)
    return float((high - low)[2] + 0.12 * (high - low)[1])


def _place(studio: Studio, figure: Figure, turn: Matrix, *, slot: Slot, scale: float) -> None:
    """Stand the figure on the slot's floor line, and draw its cage and bones over it."""
    low, high = _extent(figure, turn)
    skin_low = min(float((mesh_points(mesh) @ np.array(turn.to_3x3()).T)[:, 2].min()) for mesh in figure.meshes)
    middle = Vector((0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), skin_low))
    matrix = (
        Matrix.Translation(studio.on_plane(slot.x, slot.floor))
        @ Matrix.Scale(scale, 4)
        @ Matrix.Translation(-middle)
        @ turn
    )
    for mesh in figure.meshes:
        studio.add_mesh(mesh, matrix=matrix)
    if figure.cage_vertices is not None:
        vertices = to_world(figure.cage_vertices, matrix)
        vertices[:, 2] = np.maximum(vertices[:, 2], studio.on_plane(slot.x, slot.floor).z + 0.02)
        _add_cage(studio, vertices, figure.cage_faces)
    if figure.bones is not None:
        size = float(np.linalg.norm(high - low))
        vertices, faces = drawing.octahedra(figure.bones, limit=0.02 * size)
        toward = Matrix.Translation(-6.0 * view_direction())
        _add_lines(studio, "Bones", vertices, faces, surface=material("Bone"), matrix=toward @ matrix)


def _add_cage(studio: Studio, vertices: Array, faces: list[list[int]]) -> None:
    """Draw a cage (world space; what lies below the floor was lifted onto it) as tubes, knots and a thin film."""
    line = flat_material("Cage Lines", CAGE_BLUE)
    thin = min(1.0, (130.0 / len(faces)) ** 0.5)
    for drawn in (drawing.tubes(vertices, faces, radius=thin * 0.011), drawing.knots(vertices, radius=thin * 0.030)):
        _add_lines(studio, "Cage", *drawn, surface=line)
    film = glass_material("Cage Film", (0.10, 0.34, 0.95), opacity=0.075)
    _add_lines(studio, "Cage Film", vertices, faces, surface=film)


def _add_lines(
    studio: Studio,
    name: str,
    vertices: Array,
    faces: Array | list[list[int]],
    *,
    surface: bpy.types.Material,
    matrix: Matrix | None = None,
) -> None:
    mesh = bpy.data.meshes.new(name)
    rows = faces.tolist() if isinstance(faces, np.ndarray) else faces
    mesh.from_pydata(vertices.tolist(), [], rows)
    mesh.materials.append(surface)
    made = studio.add_mesh(mesh, matrix=matrix, shadow=False)
    made.visible_diffuse = made.visible_glossy = False


def _compose(images: Sequence[Array]) -> Array:
    """Stack the panels and tint them by a light backdrop, with two cards under the second (height by width by 3)."""
    height, width = sum(image.shape[0] for image in images), images[0].shape[1]
    fade = np.linspace(0.0, 1.0, height)[:, None, None]
    canvas = np.array([0.950, 0.957, 0.968]) * (1.0 - fade) + np.array([0.885, 0.900, 0.918]) * fade
    canvas = np.repeat(canvas, width, axis=1)
    if len(images) > 1:
        unit = width / WIDTH
        low = images[0].shape[0]
        for x0, x1 in ((0.3, 7.85), (8.15, 15.7)):
            cover = _card(canvas.shape, (low, height - 0.18 * unit), (x0 * unit, x1 * unit), radius=0.16 * unit)
            canvas += cover[..., None] * (np.array([0.99, 0.992, 0.996]) - canvas) * 0.85
    fade_rows = max(1, round(0.15 * width / WIDTH))
    images[0][-fade_rows:] += (1.0 - images[0][-fade_rows:]) * np.linspace(0.0, 1.0, fade_rows)[:, None, None]
    return canvas * np.concatenate(images)


def _card(shape: tuple[int, ...], rows: tuple[float, float], columns: tuple[float, float], *, radius: float) -> Array:
    """Coverage of a rounded rectangle, anti-aliased (height by width)."""
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    dx = np.abs(x - 0.5 * sum(columns)) - 0.5 * (columns[1] - columns[0]) + radius
    dy = np.abs(y - 0.5 * sum(rows)) - 0.5 * (rows[1] - rows[0]) + radius
    distance = np.hypot(np.maximum(dx, 0.0), np.maximum(dy, 0.0)) + np.minimum(np.maximum(dx, dy), 0.0) - radius
    return np.clip(0.5 - distance, 0.0, 1.0)


def _save(path: Path, pixels: Array) -> None:
    """Write display values (height by width by 3, top row first) as a PNG."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new(path.stem, width, height)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels[::-1]
    image.pixels.foreach_set(rgba.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)
