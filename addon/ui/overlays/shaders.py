# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing with Blender's gpu module: strokes (lines and dots of a width on the screen), and where they are drawn.

Shaders are made at the first drawing: without a window there is no graphics card to make them for.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import gpu
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from .colours import Colour
from .kept import Kept

CORNERS = np.float32([[-1, -1], [1, -1], [1, 1], [-1, 1]])  # of a stroke: along it, across it
FACES = np.int32([[0, 1, 2], [0, 2, 3]])

# A stroke is a capsule on the screen; one of no length is a dot with a dark rim. All is worked out on the screen, so
# that wide lines look alike on every graphics system, also where it draws lines of one pixel only.
VERTEX = """
void main()
{
  vec4 p = mvp * vec4(start, 1.0);
  vec4 q = mvp * vec4(end, 1.0);
  const float eye = 1e-4;
  if (p.w < eye && q.w < eye) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  if (p.w < eye) { p = mix(p, q, (eye - p.w) / (q.w - p.w)); }
  if (q.w < eye) { q = mix(q, p, (eye - q.w) / (p.w - q.w)); }
  vec2 middle = 0.5 * canvas.xy;
  vec2 from = p.xy / p.w * middle;
  vec2 to = q.xy / q.w * middle;
  float reach = distance(from, to);
  vec2 along = (reach > 1e-3) ? (to - from) / reach : vec2(1.0, 0.0);
  float radius = 0.5 * width * canvas.z;
  float grown = radius + 1.0;
  bool first = corner.x < 0.0;
  vec2 place = (first ? from : to) + grown * (along * corner.x + vec2(-along.y, along.x) * corner.y);
  gl_Position = vec4(place / middle, first ? p.z / p.w : q.z / q.w, 1.0);
  inside = vec4(first ? -grown : reach + grown, grown * corner.y, reach, radius);
  shade = colour;
  screen = place;
}
"""
FRAGMENT = """
void main()
{
  vec2 off = vec2(inside.x - clamp(inside.x, 0.0, inside.z), inside.y);
  float edge = inside.w - length(off);
  vec4 paint = shade;
  if (inside.z < 1e-3) {
    paint.rgb = mix(vec3(0.05), paint.rgb, clamp(edge - 0.9 * canvas.z, 0.0, 1.0));
  }
  paint.a *= canvas.w;
  if (pointer.z > 0.0) {
    float apart = clamp(distance(screen, pointer.xy) / pointer.z, 0.0, 1.0);
    float close = 1.0 - apart * apart;
    paint.a *= close * close;
  }
  if (pointer.w > 0.0) {
    paint.a = pow(paint.a, 1.6);  // blended in linear light, faint strokes look stronger than they should
    vec3 low = paint.rgb / 12.92;
    vec3 high = pow((paint.rgb + 0.055) / 1.055, vec3(2.4));
    paint.rgb = mix(low, high, step(vec3(0.04045), paint.rgb));
  }
  paint.a *= clamp(edge + 0.5, 0.0, 1.0);
  fragColor = paint;
}
"""


@dataclass(frozen=True)
class Strokes:
    """Lines and dots: where they start and end (`#S by 3`), their colours (`#S by 4`) and widths in pixels (`#S`)."""

    start: NDArray[np.float32]
    end: NDArray[np.float32]
    colour: NDArray[np.float32]
    width: NDArray[np.float32]

    def __add__(self, other: Strokes) -> Strokes:
        """These, and over them the other ones."""
        return Strokes(
            np.concatenate([self.start, other.start]),
            np.concatenate([self.end, other.end]),
            np.concatenate([self.colour, other.colour]),
            np.concatenate([self.width, other.width]),
        )


def lines(
    start: NDArray[np.floating], end: NDArray[np.floating], colour: Colour | NDArray[np.float32], width: float
) -> Strokes:
    """A line from each point of `start` to that of `end`, each `#S by 3`."""
    count = len(start)
    return Strokes(
        np.asarray(start, np.float32),
        np.asarray(end, np.float32),
        np.broadcast_to(np.float32(colour), (count, 4)),
        np.broadcast_to(np.float32(width), count),
    )


def dots(
    points: NDArray[np.floating], colour: Colour | NDArray[np.float32], width: float | NDArray[np.float32]
) -> Strokes:
    """A dot at each point, `#S by 3`."""
    return lines(points, points, colour, width)


class Ink:
    """The shader of all strokes, made when first needed."""

    def __init__(self) -> None:
        self._shader: Kept[gpu.types.GPUShader] = Kept("shader")

    def shader(self) -> gpu.types.GPUShader:
        return self._shader.get(True, _stroke_shader)


class Pen:
    """Draws one set of strokes; sends them to the graphics card when they have changed."""

    def __init__(self, ink: Ink) -> None:
        self._ink = ink
        self._batch: Kept[gpu.types.GPUBatch] = Kept("batch")

    def draw(
        self, strokes: Strokes, key: tuple[object, ...], matrix: Matrix, *, alpha: float = 1.0, fade: Fade | None = None
    ) -> None:
        """Draw them; `key` changes with them, and `matrix` brings their space to the screen."""
        if not len(strokes.start):
            return
        shader = self._ink.shader()
        batch = self._batch.get(key, lambda: _batch(strokes))
        _, _, width, height = gpu.state.viewport_get()
        scale = bpy.context.preferences.system.ui_scale
        shader.bind()
        shader.uniform_float("mvp", matrix)
        shader.uniform_float("canvas", (width, height, scale, alpha))
        shader.uniform_float("pointer", (0.0, 0.0, 0.0, 1.0) if fade is None else (*fade.cursor, fade.radius, 0.0))
        batch.draw(shader)


@dataclass(frozen=True)
class Fade:
    """Where the cursor is, from the middle of what is drawn on, and where strokes have faded away: in pixels."""

    cursor: tuple[float, float]
    radius: float


def _stroke_shader() -> gpu.types.GPUShader:
    info, between = gpu.types.GPUShaderCreateInfo(), gpu.types.GPUStageInterfaceInfo("cage_rig_stroke")
    info.push_constant("MAT4", "mvp")
    info.push_constant("VEC4", "canvas")  # width, height, pixels of the interface's unit, alpha
    info.push_constant("VEC4", "pointer")  # x, y, radius (0: no fading), whether the target takes linear colours
    for slot, (kind, name) in enumerate(
        (("VEC3", "start"), ("VEC3", "end"), ("VEC2", "corner"), ("VEC4", "colour"), ("FLOAT", "width"))
    ):
        info.vertex_in(slot, kind, name)
    between.smooth("VEC4", "inside")  # along and across the stroke, its length, its radius: in pixels
    between.smooth("VEC4", "shade")
    between.smooth("VEC2", "screen")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "fragColor")
    info.vertex_source(VERTEX)
    info.fragment_source(FRAGMENT)
    return gpu.shader.create_from_info(info)


def _batch(strokes: Strokes) -> gpu.types.GPUBatch:
    count = len(strokes.start)
    content = {name: np.repeat(getattr(strokes, name), 4, axis=0) for name in ("start", "end", "colour", "width")}
    content["corner"] = np.tile(CORNERS, (count, 1))
    indices = (4 * np.arange(count, dtype=np.int32)[:, None, None] + FACES).reshape(-1, 3)
    return triangles(content, gpu.types.GPUIndexBuf(type="TRIS", seq=np.ascontiguousarray(indices)))


def triangles(content: dict[str, NDArray[np.float32]], indices: gpu.types.GPUIndexBuf) -> gpu.types.GPUBatch:
    """A batch of triangles with these attributes, each `#V` or `#V by k`."""
    layout = gpu.types.GPUVertFormat()  # a shader's own `format_calc` is empty in 5.2
    for name, values in content.items():
        layout.attr_add(id=name, comp_type="F32", len=values[0].size, fetch_mode="FLOAT")
    vertices = gpu.types.GPUVertBuf(format=layout, len=len(next(iter(content.values()))))
    for name, values in content.items():
        vertices.attr_fill(name, np.ascontiguousarray(values, np.float32))
    return gpu.types.GPUBatch(type="TRIS", buf=vertices, elem=indices)


def nearer(view: Matrix, projection: Matrix, to_world: Matrix, offset: float) -> Matrix:
    """The view matrix, with what `to_world` places brought nearer to the eye by `offset`, unmoved on the screen."""
    place = view @ to_world.translation
    if projection[3][3] == 0.0:  # perspective: towards the eye everything shrinks
        share = max(0.9, 1.0 - offset / max(abs(place.z), 1e-6))
        return Matrix.Scale(share, 4) @ view
    return Matrix.Translation((0.0, 0.0, offset)) @ view


@contextmanager
def placed(to_world: Matrix, offset: float) -> Iterator[None]:
    """Draw with Blender's own shaders in a space of its own, a little nearer than it is."""
    view = gpu.matrix.get_model_view_matrix()
    with gpu.matrix.push_pop():
        gpu.matrix.load_matrix(nearer(view, gpu.matrix.get_projection_matrix(), to_world, offset) @ to_world)
        yield


def to_screen(to_world: Matrix, offset: float = 0.0) -> Matrix:
    """The matrix from a space to the screen of the 3D View that is being drawn."""
    projection, view = gpu.matrix.get_projection_matrix(), gpu.matrix.get_model_view_matrix()
    return projection @ nearer(view, projection, to_world, offset) @ to_world


def over(*, in_front: bool) -> None:
    """Blend what is drawn next over the picture: all of it, or what no surface hides."""
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("NONE" if in_front else "LESS_EQUAL")


@contextmanager
def tidy() -> Iterator[None]:
    """Draw, and leave the graphics state as it was."""
    blend, depth, writes = gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get()
    gpu.state.depth_mask_set(False)
    try:
        yield
    finally:
        gpu.state.blend_set(blend)
        gpu.state.depth_test_set(depth)
        gpu.state.depth_mask_set(writes)
