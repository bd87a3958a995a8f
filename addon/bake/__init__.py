# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes: what a rig shows over a frame range, as files or objects that need no add-on.

    from bl_ext.user_default.cage_rig import bake
    bake.to_mesh_cache(bpy.data.objects["Cage"], "//walk.pc2", 1, 48, samples=4)

Each function takes the rest cage object of a live rig, in Object Mode, and the first and last frame, both included
(None: the scene's). It leaves the rig, the frame, the selection and what is hidden as they are, and returns a record
of what it made, which has a `summary`. Where it can't, it raises `BakeError` with a sentence, and nothing is left: no
file, no part of one, no datablock. Paths may begin with `//`; an empty path means the folder of the .blend, and a
folder a file in it, named as the cage. New objects are in a collection of their own.

The work is that of generators (`mesh_cache.steps`, `scenes.alembic_steps`, …) that yield their progress, 0 to 1, after
each frame and can be closed at any of these points, which takes everything back: the operator runs one of those.
"""

from __future__ import annotations

import bpy

from . import mesh_cache, native_rig, scenes, shape_keys
from .live import BakeError, Steps, run
from .mesh_cache import MeshCaches
from .native_rig import NativeRig
from .scenes import SceneFile
from .shape_keys import KeyedShapes

__all__ = [
    "BakeError",
    "KeyedShapes",
    "MeshCaches",
    "NativeRig",
    "SceneFile",
    "Steps",
    "run",
    "to_alembic",
    "to_mesh_cache",
    "to_native_rig",
    "to_shape_keys",
    "to_usd",
]


def to_mesh_cache(
    cage: bpy.types.Object,
    path: str = "",
    frame_start: int | None = None,
    frame_end: int | None = None,
    *,
    samples: int = 1,
    result: bool = True,
) -> MeshCaches:
    """Bake to PC2 point caches, `samples` a frame: what stands where our modifier does, in each skin's own space.

    Modifiers after ours are not in it, its shape keys and the modifiers before ours are. One skin: the file is `path`;
    several: its name with `-` and the skin's. `result`: copies of the skins with Mesh Cache modifiers that play the
    files, their later modifiers kept, and parented as the skins are.
    """
    start, end = _range(frame_start, frame_end)
    return run(mesh_cache.steps(cage, path, start, end, samples=samples, result=result))


def to_alembic(
    cage: bpy.types.Object,
    path: str = "",
    frame_start: int | None = None,
    frame_end: int | None = None,
    *,
    samples: int = 1,
    subdivide: bool = False,
    result: bool = False,
) -> SceneFile:
    """Bake the skins, with all their modifiers and in the world, by Blender's Alembic exporter; `samples` a frame.

    `subdivide`: also a Subdivision Surface modifier at the end. `result`: import the file. The export is one call, at
    the frames of which nothing can be cancelled.
    """
    start, end = _range(frame_start, frame_end)
    return run(scenes.alembic_steps(cage, path, start, end, samples=samples, subdivide=subdivide, result=result))


def to_usd(
    cage: bpy.types.Object,
    path: str = "",
    frame_start: int | None = None,
    frame_end: int | None = None,
    *,
    subdivide: bool = False,
    result: bool = False,
) -> SceneFile:
    """Bake the skins as `to_alembic` does, by Blender's USD exporter, which knows whole frames only.

    The suffix of `path` says which kind of file: .usdc (also without one), .usda or .usd. Textures are referred to
    where they are.
    """
    start, end = _range(frame_start, frame_end)
    return run(scenes.usd_steps(cage, path, start, end, subdivide=subdivide, result=result))


def to_shape_keys(
    cage: bpy.types.Object, frame_start: int | None = None, frame_end: int | None = None, *, step: int = 1
) -> KeyedShapes:
    """Bake to copies of the skins with one relative shape key every `step` frames, keyed so that each shows itself.

    At those frames the copies equal the skins, between them they go in straight lines. Modifiers after ours stay.
    """
    start, end = _range(frame_start, frame_end)
    return run(shape_keys.steps(cage, start, end, step=step))


def to_native_rig(
    cage: bpy.types.Object,
    frame_start: int | None = None,
    frame_end: int | None = None,
    *,
    samples: int = 1,
    keep_action: bool = False,
) -> NativeRig:
    """Bake a rig with a still rest cage to skins and an armature that Blender's Armature modifier plays alike.

    For the methods Linear and, where Blender's Preserve Volume does the same, Dual Quaternion. Every bone is keyed,
    `samples` a frame; constraints and drivers are in the keys. With `keep_action` the copy plays the armature's own
    action instead, which is refused where constraints make that another motion. `error` of the result is the farthest
    that any vertex is from the live rig at any of the times, as a share of the character's size: around 1e-6; more than
    1e-4 is refused.
    """
    start, end = _range(frame_start, frame_end)
    return run(native_rig.steps(cage, start, end, samples=samples, keep_action=keep_action))


def _range(start: int | None, end: int | None) -> tuple[int, int]:
    scene = bpy.context.scene
    return scene.frame_start if start is None else start, scene.frame_end if end is None else end
