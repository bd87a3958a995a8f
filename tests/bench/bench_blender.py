"""Whole frames, binds and idling in Blender beside its own Mesh Deform and Armature modifiers, on the same meshes.

`--quick` checks the answers of one small character alone.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent / "blender")]
sys.path.insert(0, str(Path(__file__).parents[2]))
from rows import Row, keep, least
from scene import Rig, bind, drag, enter_edit_mode, leave_edit_mode, select, shown, update
from tube import tube

from blend_fixtures.build import RigObjects, build_biped, build_character

QUICK = "--quick" in sys.argv
ROUNDS = 3 if QUICK else 150
TURNS = 1 if QUICK else 3  # ours and Blender's, one after the other
BONES = 24
HIDDEN = {(2_000, 44), (10_000, 44), (40_000, 44)}  # sizes that are measured with all but the skin hidden too
PEER = "Mesh Deform (precision 5) + Armature"


def empty() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def animated(vertices: int, cage: int, *, keys: int = 1) -> RigObjects:
    """A tube whose bones and cage all move from frame 1 to 48: the cage to one key, or through several out of step."""
    objects = build_character(tube(vertices, BONES, cage))
    for number, bone in enumerate(objects.armature.pose.bones):
        bone.rotation_mode = "XYZ"
        for frame, share in ((1, 0.0), (48, 1.0)):
            bone.rotation_euler = (0.001 * share, 0.0, 0.05 * share * np.sin(number))
            bone.keyframe_insert("rotation_euler", frame=frame)
    objects.cage.shape_key_add(name="Basis")
    for number in range(keys):
        key = objects.cage.shape_key_add(name=f"Stretched {number}")
        points = np.empty((len(objects.cage.data.vertices), 3), np.float32)
        key.points.foreach_get("co", points.ravel())
        swell = np.sin(number * number * np.arange(len(points), dtype=np.float32))[:, None]
        key.points.foreach_set("co", (points * np.float32([1.0, 1.2, 1.3]) + 0.05 * swell).ravel())
        for frame, value in ((1, 0.0), (5 + 8 * number, 1.0 / (1 + number)), (48, 1.0 / keys)):
            if keys > 1 or frame in (1, 48):
                key.value = value
                key.keyframe_insert("value", frame=frame)
    return objects


def play() -> Callable[[], None]:
    """An act that goes to the next frame, and from the last one to the second: in the first one the cage rests, and a
    product that moves nothing is free.
    """
    frame = [2]

    def act() -> None:
        frame[0] = frame[0] + 1 if frame[0] < 46 else 2
        bpy.context.scene.frame_set(frame[0])

    return act


def mesh_deform(skin: bpy.types.Object, cage: bpy.types.Object) -> float:
    """Give the skin Blender's own cage, bound before its Armature modifier; returns the bind's milliseconds."""
    modifier = skin.modifiers.new("Mesh Deform", "MESH_DEFORM")
    modifier.object, modifier.precision = cage, 5
    skin.modifiers.move(len(skin.modifiers) - 1, 0)
    select([skin], skin)
    start = time.perf_counter()
    bpy.ops.object.meshdeform_bind(modifier="Mesh Deform")
    assert modifier.is_bound
    return (time.perf_counter() - start) * 1e3


def session_of(rig: Rig) -> Any:
    """The running session of the rig."""
    from bl_ext.user_default.cage_rig import sync

    return sync.session_of(rig.cage)


def core_agrees(rig: Rig) -> None:
    """What Blender shows is what the equations say of the cage and bones that it shows, through numpy in float64."""
    session, found = session_of(rig), shown(rig.skin)
    assert rig.settings.state == "LIVE" and np.isfinite(found).all()
    core = session.rig
    rest = session.snapshot.skins[0].points + core.cage_coords @ (core.rest_cage - session.snapshot.cage)
    indptr, columns, values = session.snapshot.skins[0].weights
    rows = np.repeat(np.arange(len(rest)), np.diff(indptr))
    blend = np.zeros((len(rest), 3, 4))
    values = values / np.bincount(rows, values, minlength=len(rest))[rows]
    np.add.at(blend, rows, values[:, None, None] * core.transforms[columns, :3])
    expected = np.einsum("mrc,mc->mr", blend[:, :, :3], rest) + blend[:, :, 3]
    assert np.abs(found - expected).max() < 2e-6 * session.size


def coordinates_alone(rig: Rig) -> float:
    """Milliseconds that the coordinates of a bind take."""
    from bl_ext.user_default.cage_rig import session

    bound = session_of(rig).snapshot
    points = bound.skins[0].points
    return least(lambda: session.mean_value_coordinates(points, bound.cage, bound.cage_faces), rounds=3)[0]


def frame_and_bind(vertices: int, cage: int) -> list[Row]:
    """A whole frame (frame_set to evaluated mesh) and the bind, against Blender's own on the same meshes."""
    empty()
    objects = animated(vertices, cage)
    skin = objects.skins[0]
    count = len(skin.data.vertices)
    best: dict[str, float] = {}

    def keep_least(**found: float) -> None:
        best.update({name: min(taken, best.get(name, taken)) for name, taken in found.items()})

    for _ in range(TURNS):
        start = time.perf_counter()
        rig = bind(objects)
        keep_least(bound=(time.perf_counter() - start) * 1e3)
        bpy.context.scene.frame_set(30)
        core_agrees(rig)
        keep_least(alone=coordinates_alone(rig), ours=least(play(), rounds=ROUNDS)[0])
        for beside in (rig.posed, rig.refit):
            beside.hide_set(True)
        update()
        keep_least(hidden=least(play(), rounds=ROUNDS)[0])
        core_agrees(rig)
        select([rig.cage], rig.cage)
        bpy.ops.cage_rig.unbind()
        bpy.context.scene.frame_set(1)
        keep_least(bound_peer=mesh_deform(skin, objects.cage), peer=least(play(), rounds=ROUNDS)[0])
        skin.modifiers.remove(skin.modifiers["Mesh Deform"])
    ours, peer, alone, bound, bound_peer = (best[name] for name in ("ours", "peer", "alone", "bound", "bound_peer"))
    label = f"{count:,} vertices, cage of {cage}"
    hidden = Row(
        f"frame in Blender, posed cage and refit bones hidden: {label}",
        "the same where only the skin is to be seen, as in Blender's stack",
        best["hidden"],
        peer,
        PEER,
    )
    return [
        Row(f"frame in Blender: {label}", "what playback waits for, bones moving and the cage keyed", ours, peer, PEER),
        *([hidden] if (vertices, cage) in HIDDEN else []),
        Row(
            f"coordinates of a bind: {label}",
            "all that a Mesh Deform bind makes",
            alone,
            bound_peer,
            "Mesh Deform bind",
        ),
        Row(f"bind in Blender: {label}", "reading weights, coordinates, joints, anchors, writing", bound),
    ]


def free_frame(vertices: int, cage: int) -> Row:
    """A whole frame whose cage goes through more shapes than are kept, so that every frame reads all of Φ."""
    empty()
    objects, best = animated(vertices, cage, keys=6), [float("inf"), float("inf")]
    skin = objects.skins[0]
    for _ in range(TURNS):
        rig = bind(objects)
        best[0] = min(best[0], *least(play(), rounds=ROUNDS))
        core_agrees(rig)
        work = session_of(rig).rig.work
        assert work["rest_shape_passes"] < 0.1 * work["rest_passes"], "a free cage is no shape"
        select([rig.cage], rig.cage)
        bpy.ops.cage_rig.unbind()
        bpy.context.scene.frame_set(1)
        mesh_deform(skin, objects.cage)
        best[1] = min(best[1], *least(play(), rounds=ROUNDS))
        skin.modifiers.remove(skin.modifiers["Mesh Deform"])
    label = f"frame in Blender, six keys of the cage out of step: {len(skin.data.vertices):,} vertices, cage of {cage}"
    return Row(label, "a cage that moves freely, as by physics or many keys", *best, PEER)


def posed_drag() -> Row:
    """A drag of the posed cage in Edit Mode, per mouse move; Blender has nothing that does this."""
    empty()
    rig = bind(build_biped())
    bpy.context.scene.frame_set(12)
    enter_edit_mode(rig.posed)
    before = shown(rig.cage).copy()
    (taken,) = least(lambda: drag(rig.posed, 40, (0.0005, 0.0, 0.0)), rounds=ROUNDS)
    leave_edit_mode()
    assert np.abs(shown(rig.cage) - before).max() > 1e-5, "the rest cage follows the drag"
    return Row("drag of the posed cage, per mouse move: biped", "Blender has nothing that does this", taken)


def idle(rigs: int) -> Row:
    """What our handlers add to an update that touches no rig."""
    empty()
    for _ in range(rigs):
        bind(build_character(tube(500, 4, 44)))
    other = bpy.data.objects.new("Elsewhere", None)
    bpy.context.scene.collection.objects.link(other)
    update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    ours = [handler for handler in bpy.app.handlers.depsgraph_update_post if "cage_rig" in handler.__module__]
    (taken,) = least(lambda: [handler(bpy.context.scene, depsgraph) for handler in ours], rounds=10, turn=50)
    return Row(f"idle handlers, {rigs} rigs in the scene", "every update that touches no rig pays it", taken)


def crowd() -> list[Row]:
    """Characters in one scene: a frame's cost grows with their number and no faster."""
    empty()
    found: list[Row] = []
    size = 500 if QUICK else 20_000
    for count in range(1, 3 if QUICK else 21):
        bind(animated(size, 44))
        if count in (1, 2, 5, 10, 20):
            bpy.context.scene.frame_set(7)
            (taken,) = least(play(), rounds=ROUNDS)
            found.append(Row(f"frame in Blender: {count} characters of {size:,} vertices", "a crowd", taken))
    return found


def main() -> None:
    if QUICK:
        keep("blender-quick", [*frame_and_bind(2_000, 44), free_frame(2_000, 44), *crowd(), idle(2)])
        return
    rows: list[Row] = []
    for size in ((2_000, 44), (10_000, 44), (40_000, 44), (120_000, 44), (40_000, 194)):
        rows += frame_and_bind(*size)
    rows += [free_frame(10_000, 44), free_frame(40_000, 44)]
    keep("blender", [*rows, *crowd(), posed_drag(), idle(20)])


if __name__ == "__main__":
    main()
