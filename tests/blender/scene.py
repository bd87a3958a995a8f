"""What the Blender tests share: characters in the scene, reading what Blender shows, editing as an artist does."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import bmesh
import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from blend_fixtures.bar import bar, box_cage
from blend_fixtures.build import RigObjects, add_cage, build_character

Points = NDArray[np.float32]


@dataclass(frozen=True)
class Rig:
    """A bound character."""

    skins: list[bpy.types.Object]
    armature: bpy.types.Object
    cage: bpy.types.Object

    @property
    def skin(self) -> bpy.types.Object:
        return self.skins[0]

    @property
    def settings(self) -> bpy.types.PropertyGroup:
        return self.cage.cage_rig

    @property
    def posed(self) -> bpy.types.Object:
        return self.settings.posed_cage

    @property
    def refit(self) -> bpy.types.Object:
        return self.settings.refit_armature

    @property
    def size(self) -> float:
        points = rest(self.skin)
        return float(np.linalg.norm(points.max(0) - points.min(0)))


def select(objects: Iterable[bpy.types.Object], active: bpy.types.Object | None) -> None:
    for obj in bpy.context.view_layer.objects:
        obj.select_set(False)
    for obj in objects:
        obj.select_set(True)
    bpy.context.view_layer.objects.active = active


def bind(objects: RigObjects) -> Rig:
    """Bind as the artist does: select everything, the cage active, and call the operator."""
    select(objects.all, objects.cage)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    return Rig(objects.skins, objects.armature, objects.cage)


def build_bar() -> RigObjects:
    """The bar, not bound, its cage without shape keys."""
    return build_character(replace(bar(), shape_keys={}))


def bound_bar() -> Rig:
    return bind(build_bar())


def small_cage(name: str = "HandCage") -> bpy.types.Object:
    """A cage around the end of the bar alone."""
    return add_cage(name, box_cage([0.45, 0.8, 1.15], half=0.3))


def partly_caged() -> Rig:
    """The bar, bound to a cage around its end."""
    objects = build_bar()
    bpy.data.objects.remove(objects.cage)
    return bind(RigObjects(objects.skins, objects.armature, small_cage()))


def update() -> None:
    bpy.context.view_layer.update()


def rest(obj: bpy.types.Object) -> Points:
    """Base coordinates, `#V by 3`."""
    points = np.empty((len(obj.data.vertices), 3), np.float32)
    obj.data.vertices.foreach_get("co", points.ravel())
    return points


def shown(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph | None = None) -> Points:
    """Evaluated coordinates in the object's space, `#V by 3`."""
    depsgraph = depsgraph or bpy.context.evaluated_depsgraph_get()
    mesh = obj.evaluated_get(depsgraph).data
    points = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    return points


def file_state() -> dict[str, object]:
    """All that a bind could change in a file, to compare."""
    state: dict[str, object] = {}
    for obj in bpy.data.objects:
        entry: dict[str, object] = {
            "matrix": [tuple(row) for row in obj.matrix_world],
            "parent": obj.parent.name if obj.parent else None,
            "collections": sorted(c.name for c in obj.users_collection),
            "modifiers": [
                (m.name, m.type, m.show_viewport, m.show_render, getattr(m, "use_vertex_groups", None))
                for m in obj.modifiers
            ],
            "groups": [g.name for g in obj.vertex_groups],
            "constraints": [c.name for c in obj.constraints],
            "state": (obj.cage_rig.state, obj.cage_rig.part, obj.cage_rig.owner, len(obj.cage_rig.suspended)),
        }
        if obj.type == "MESH":
            entry["points"] = rest(obj).tobytes()
            entry["attributes"] = sorted(a.name for a in obj.data.attributes)
        else:
            entry["pose"] = obj.data.pose_position
            entry["bones"] = [(b.name, tuple(b.head_local), b.use_connect) for b in obj.data.bones]
        state[obj.name] = entry
    for kind in ("meshes", "armatures", "node_groups", "actions", "collections"):
        state[kind] = sorted(item.name for item in getattr(bpy.data, kind))
    return state


@contextmanager
def plain_blender(skin: bpy.types.Object) -> Iterator[None]:
    """Our modifier off and the Armature modifier on: what Blender alone would show."""
    ours, native = skin.modifiers["Cage Rig"], skin.modifiers["Armature"]
    ours.show_viewport, native.show_viewport = False, True
    update()
    yield
    ours.show_viewport, native.show_viewport = True, False
    update()


def native(skin: bpy.types.Object) -> Points:
    """The skin as Blender's own Armature modifier poses it."""
    with plain_blender(skin):
        return shown(skin)


def bend(rig: Rig, angle: float, bone: str = "upper") -> None:
    pose_bone = rig.armature.pose.bones[bone]
    pose_bone.rotation_mode = "XYZ"
    pose_bone.rotation_euler = (0.0, 0.0, angle)
    update()


def set_mesh(obj: bpy.types.Object, points: Points) -> None:
    """Move the vertices of a mesh in Object Mode, as a script does."""
    obj.data.vertices.foreach_set("co", np.ascontiguousarray(points, np.float32).ravel())
    obj.data.update()
    update()


def enter_edit_mode(*objects: bpy.types.Object) -> None:
    select(objects, objects[0])
    bpy.ops.object.mode_set(mode="EDIT")


def leave_edit_mode() -> None:
    bpy.ops.object.mode_set(mode="OBJECT")
    update()


def edited(obj: bpy.types.Object) -> Points:
    """Coordinates of the edit mesh."""
    return np.array([vertex.co for vertex in bmesh.from_edit_mesh(obj.data).verts], np.float32)


def drag(obj: bpy.types.Object, vertex: int, offset: tuple[float, float, float]) -> None:
    """Move one vertex of the edit mesh, as one mouse move of a drag does."""
    edit = bmesh.from_edit_mesh(obj.data)
    edit.verts.ensure_lookup_table()
    edit.verts[vertex].co += Vector(offset)
    bmesh.update_edit_mesh(obj.data)
    update()


def fat_key(rig: Rig, factor: float = 1.6, value: float = 1.0) -> bpy.types.ShapeKey:
    """A shape key of the rest cage that fattens it around its axis and stretches it."""
    if rig.cage.data.shape_keys is None:
        rig.cage.shape_key_add(name="Basis", from_mix=False)
    key = rig.cage.shape_key_add(name="Fat", from_mix=False)
    key.points.foreach_set("co", (rest(rig.cage) * np.float32([1.2, factor, factor])).ravel())
    key.value = value
    update()
    return key


def fresh(rig: Rig) -> list[Points]:
    """The skins as a session made anew from the file computes them now."""
    import bl_ext.user_default.cage_rig.sync as sync

    sync.forget()
    sync.restored()
    update()
    return [shown(skin) for skin in rig.skins]


@contextmanager
def unwatched() -> Iterator[None]:
    """Cage Rig's handlers are silent: what is done to a file meanwhile, nobody mends or refuses."""
    handlers = bpy.app.handlers
    names = ("depsgraph_update_post", "frame_change_post", "load_post", "undo_post", "redo_post")
    names += ("save_pre", "save_post", "save_post_fail")
    before = {name: list(getattr(handlers, name)) for name in names}
    for name in names:
        getattr(handlers, name).clear()
    try:
        yield
    finally:
        for name, found in before.items():
            getattr(handlers, name)[:] = found
