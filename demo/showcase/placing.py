"""Puts frozen figures into a studio: how large, where on the floor, with their cage and bones drawn over them."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from blend_fixtures.materials import material

from . import drawing
from .figures import Array, Figure, mesh_points, to_world
from .studio import Studio, flat_material, glass_material, view_direction

CAGE_BLUE = (0.02, 0.16, 0.72)


@dataclass(frozen=True)
class Slot:
    """A place on a panel, in units: the middle of its floor line, and how far above it the figure hovers."""

    x: float
    floor: float
    hover: float = 0.0


def extent(figure: Figure, turn: Matrix) -> tuple[Array, Array]:
    """The corners of the turned figure's box (3 each)."""
    points = figure.points() @ np.array(turn.to_3x3()).T
    return points.min(axis=0), points.max(axis=0)


def fitting_scale(figure: Figure, turn: Matrix, *, width: float, height: float) -> float:
    """The scale at which the figure fills `width` by `height` units."""
    low, high = extent(figure, turn)
    return float(min(width / (high - low)[0], height / seen_height(figure, turn)))


def seen_height(figure: Figure, turn: Matrix) -> float:
    """How high the figure stands in the picture, in its own units; the camera looks down a little."""
    low, high = extent(figure, turn)
    return float((high - low)[2] + 0.12 * (high - low)[1])


def place(
    studio: Studio,
    figure: Figure,
    turn: Matrix,
    *,
    slot: Slot,
    scale: float,
    origin: Vector | None = None,
    line: float = 1.0,
) -> None:
    """Stand the figure on the slot's floor line, and draw its cage and bones over it.

    `origin`: the turned figure's point that comes onto the middle of that line; None: below its middle. `line`: how
    bold the cage is.
    """
    low, high = extent(figure, turn)
    skin_low = min(float((mesh_points(mesh) @ np.array(turn.to_3x3()).T)[:, 2].min()) for mesh in figure.meshes)
    middle = Vector((0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), skin_low))
    matrix = (
        Matrix.Translation(studio.on_plane(slot.x, slot.floor + slot.hover))
        @ Matrix.Scale(scale, 4)
        @ Matrix.Translation(-(middle if origin is None else origin))
        @ turn
    )
    for mesh in figure.meshes:
        studio.add_mesh(mesh, matrix=matrix)
    if figure.cage_vertices is not None:
        vertices = to_world(figure.cage_vertices, matrix)
        vertices[:, 2] = np.maximum(vertices[:, 2], studio.on_plane(slot.x, slot.floor).z + 0.02)
        _add_cage(studio, vertices, figure.cage_faces, line=line)
    if figure.bones is not None:
        size = float(np.linalg.norm(high - low))
        vertices, faces = drawing.octahedra(figure.bones, limit=0.02 * size)
        toward = Matrix.Translation(-6.0 * view_direction())
        add_lines(studio, "Bones", vertices, faces, surface=material("Bone"), matrix=toward @ matrix)


def add_lines(
    studio: Studio,
    name: str,
    vertices: Array,
    faces: Array | list[list[int]],
    *,
    surface: bpy.types.Material,
    matrix: Matrix | None = None,
) -> bpy.types.Object:
    """Add a mesh that is drawn, but throws no shadow and lights nothing."""
    mesh = bpy.data.meshes.new(name)
    rows = faces.tolist() if isinstance(faces, np.ndarray) else faces
    mesh.from_pydata(vertices.tolist(), [], rows)
    mesh.materials.append(surface)
    made = studio.add_mesh(mesh, matrix=matrix, shadow=False)
    made.visible_diffuse = made.visible_glossy = False
    return made


def _add_cage(studio: Studio, vertices: Array, faces: list[list[int]], *, line: float) -> None:
    """Draw a cage (world space; what lies below the floor was lifted onto it) as tubes, knots and a thin film."""
    ink = flat_material("Cage Lines", CAGE_BLUE)
    thin = line * min(1.0, (130.0 / len(faces)) ** 0.5)
    for drawn in (drawing.tubes(vertices, faces, radius=thin * 0.011), drawing.knots(vertices, radius=thin * 0.030)):
        add_lines(studio, "Cage", *drawn, surface=ink)
    film = glass_material("Cage Film", (0.10, 0.34, 0.95), opacity=0.075)
    add_lines(studio, "Cage Film", vertices, faces, surface=film)
