"""What the tests of bakes share: playing a baked copy beside the live rig, and everything that a bake may not touch."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
from scene import Points, Rig, bind, fat_key, rest, set_mesh, shown

from blend_fixtures import rigs

FRAMES = (1, 2, 7, 13, 20, 25)


def bake() -> ModuleType:
    """The package that scripts import; enabled with the extension."""
    import bl_ext.user_default.cage_rig.bake as package

    return package


def keyed_rig(name: str = "keyed_locations") -> Rig:
    """A rig of `rigs.RIGS` with its action, whose cage grows fat and long meanwhile."""
    rig = bind(rigs.build_rig(name))
    key = fat_key(rig, value=0.0)
    key.keyframe_insert("value", frame=1)
    key.value = 1.0
    key.keyframe_insert("value", frame=25)
    go_to(1)
    return rig


def shaped_rig(name: str) -> Rig:
    """A rig of `rigs.RIGS` with its action, whose cage stands still in another shape, its joints elsewhere."""
    rig = bind(rigs.build_rig(name))
    set_mesh(rig.cage, rest(rig.cage) * np.float32([1.2, 1.5, 1.4]) + np.float32([0.1, 0.2, 0.0]))
    return rig


def go_to(time: float) -> None:
    whole = math.floor(time)
    bpy.context.scene.frame_set(whole, subframe=time - whole)


def world(obj: bpy.types.Object) -> Points:
    """Evaluated points in the world, `#V by 3`."""
    matrix = np.array(obj.matrix_world)
    return shown(obj) @ matrix[:3, :3].T + matrix[:3, 3]


def worst(rig: Rig, copies: Iterable[bpy.types.Object], times: Iterable[float] = FRAMES) -> float:
    """Largest distance of the copies of the rig's skins from the live ones over the times, as a share of the size."""
    meshes = [obj for obj in copies if obj.type == "MESH"]
    assert len(meshes) == len(rig.skins)
    found = 0.0
    for time in times:
        go_to(time)
        for skin in rig.skins:
            copy = meshes[0] if len(meshes) == 1 else next(obj for obj in meshes if obj.name.startswith(skin.name))
            found = max(found, float(np.abs(world(copy) - world(skin)).max()) / extent(rig))
    return found


def extent(rig: Rig) -> float:
    """Size of the character in the world."""
    points = np.concatenate([world(skin) for skin in rig.skins])
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def everything() -> dict[str, list[str]]:
    """The names of all datablocks of the file, by kind."""
    kinds = [prop.identifier for prop in bpy.data.bl_rna.properties if prop.type == "COLLECTION"]
    return {kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in kinds}


def state() -> list[object]:
    """What of the scene a bake may not change: the frame, and how every object is seen, selected and deformed."""
    scene, layer = bpy.context.scene, bpy.context.view_layer.objects
    found: list[object] = [scene.frame_current, scene.frame_subframe, scene.frame_start, scene.frame_end, layer.active]
    for obj in bpy.data.objects:
        found.append((obj.name, obj.hide_viewport, obj.hide_render, obj.hide_select, obj.animation_data is not None))
        found.append([(mod.name, mod.show_viewport) for mod in obj.modifiers])
        found.append((obj.mode, sorted(owner.name for owner in obj.users_collection)))
        if obj.name in layer:
            found.append((obj.select_get(), obj.hide_get()))
    return found


@contextmanager
def untouched(*, folder: Path | None = None) -> Iterator[None]:
    """Nothing comes, goes or changes within: datablocks, the scene, the files of `folder`."""
    before = everything(), state(), sorted(folder.iterdir()) if folder else []
    yield
    assert everything() == before[0]
    assert state() == before[1]
    assert (sorted(folder.iterdir()) if folder else []) == before[2]
