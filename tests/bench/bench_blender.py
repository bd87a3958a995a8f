"""Named scenarios, each beside what a user would pick instead, in the same process: the table that `make bench` prints.

Only ratios within one run count: these machines are shared. Every scenario checks its own answer once.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

sys.path[:0] = [str(Path(__file__).parent.parent / "blender"), str(Path(__file__).parent.parent.parent)]
from scene import bind, drag, enter_edit_mode, leave_edit_mode, select, shown, update

from blend_fixtures.bar import bar
from blend_fixtures.build import RigObjects, build_biped, build_character

ROUNDS = 15


@dataclass(frozen=True)
class Row:
    """One line of the table; times in milliseconds, `peer` None where nothing else does the job."""

    scenario: str
    ours: float
    peer: float | None
    beside: str


def median(act: Callable[[], None], rounds: int = ROUNDS) -> float:
    """Median wall time of an act in milliseconds, after two rounds to warm up."""
    times = []
    for _ in range(rounds + 2):
        start = time.perf_counter()
        act()
        times.append(time.perf_counter() - start)
    return float(np.median(times[2:])) * 1e3


def empty() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def long_bar(segments: int, across: int) -> RigObjects:
    return build_character(bar(segments=segments, across=across))


def key_everything(objects: RigObjects) -> None:
    """Bones and cage both move on every frame from 1 to 48."""
    bone = objects.armature.pose.bones[1]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (48, 1.4)):
        bone.rotation_euler = (0, 0, angle)
        bone.keyframe_insert("rotation_euler", frame=frame)
    key = objects.cage.data.shape_keys.key_blocks[-1]
    for frame, value in ((1, 0.0), (48, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


def play() -> Callable[[], None]:
    """An act that goes to the next frame, back and forth."""
    frame = [1]

    def act() -> None:
        frame[0] = frame[0] % 46 + 1
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


def frame_and_bind(name: str, make: Callable[[], RigObjects]) -> list[Row]:
    """A whole frame (frame_set to evaluated mesh) and the bind, against Mesh Deform + Armature on the same meshes."""
    empty()
    objects = make()
    key_everything(objects)
    count = sum(len(skin.data.vertices) for skin in objects.skins)
    start = time.perf_counter()
    rig = bind(objects)
    bound = (time.perf_counter() - start) * 1e3
    bpy.context.scene.frame_set(30)
    assert rig.settings.state == "LIVE" and np.isfinite(shown(rig.skin)).all()
    ours = median(play())
    for skin in objects.skins:
        skin.modifiers.remove(skin.modifiers["Cage Rig"])
    select([rig.cage], rig.cage)
    bpy.ops.cage_rig.unbind()
    bpy.context.scene.frame_set(1)
    peer_bind = sum(mesh_deform(skin, objects.cage) for skin in objects.skins)
    peer = median(play())
    label = f"{name}, {count:,} vertices, cage of {len(objects.cage.data.vertices)}"
    return [
        Row(f"frame: {label}", ours, peer, "Mesh Deform (precision 5) + Armature"),
        Row(f"bind: {label}", bound, peer_bind, "Mesh Deform bind (precision 5)"),
    ]


def posed_drag() -> list[Row]:
    """A drag of the posed cage in Edit Mode, per mouse move; Blender has nothing that does this."""
    empty()
    rig = bind(build_biped())
    bpy.context.scene.frame_set(12)
    enter_edit_mode(rig.posed)
    before = shown(rig.cage).copy()
    time_taken = median(lambda: drag(rig.posed, 40, (0.0005, 0.0, 0.0)))
    leave_edit_mode()
    assert np.abs(shown(rig.cage) - before).max() > 1e-4, "the rest cage follows the drag"
    return [Row("drag of the posed cage, per mouse move: biped", time_taken, None, "nothing")]


def idle(rigs: int = 20) -> list[Row]:
    """What the handlers add to an update that touches no rig, with 20 rigs in the file."""
    empty()
    for _ in range(rigs):
        bind(long_bar(20, 4))
    other = bpy.data.objects.new("Elsewhere", None)
    bpy.context.scene.collection.objects.link(other)
    update()
    handlers = bpy.app.handlers.depsgraph_update_post
    ours = next(handler for handler in handlers if "cage_rig" in handler.__module__)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return [Row(f"idle handler with {rigs} rigs", median(lambda: ours(bpy.context.scene, depsgraph), 200), None, "")]


def kernel() -> list[Row]:
    """The core alone, all cage vertices and bones moving, against numpy's best float32."""
    import cage_rig_core

    character = bar(segments=400, across=25)
    skin, cage = character.skins[0], character.cage
    faces = np.asarray(skin.faces)
    corners = np.concatenate([np.asarray(face) for face in cage.faces])
    sizes = np.array([len(face) for face in cage.faces])
    rig = cage_rig_core.CoupledRig(
        skin.vertices, (faces.ravel(), np.full(len(faces), faces.shape[1])), skin.weights,
        np.array([bone.head for bone in character.bones], float), np.array([-1, 0]), cage.vertices, (corners, sizes),
    )  # fmt: skip
    coords, weights = np.float32(rig.cage_coords), np.float32(skin.weights)
    points = np.float32(skin.vertices)
    out, transforms = np.empty_like(points), np.tile(np.eye(4), (2, 1, 1))
    step = [0]

    def shape() -> np.ndarray:
        step[0] += 1
        turn = 0.01 * step[0]
        transforms[1, :2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        return cage.vertices * (1.0 + 0.001 * step[0])

    def ours() -> None:
        rig.play(shape(), transforms)
        rig.posed_skin_into(out)

    def numpy_way() -> np.ndarray:
        moved = points + coords @ np.float32(shape() - cage.vertices)
        blend = (weights @ np.float32(rig.transforms[:, :3]).reshape(2, 12)).reshape(-1, 3, 4)
        return np.einsum("mrc,mc->mr", blend[:, :, :3], moved) + blend[:, :, 3]

    ours()
    step[0] -= 1
    assert np.abs(numpy_way() - out).max() < 1e-5
    name = f"core: rest skin and LBS, {len(points):,} vertices, cage of {len(cage.vertices)}"
    return [Row(name, median(ours), median(lambda: numpy_way()), "numpy float32")]


def table(rows: list[Row]) -> str:
    lines = ["| scenario | ours, ms | instead, ms | times faster | beside |", "| --- | ---: | ---: | ---: | --- |"]
    for row in rows:
        peer = "–" if row.peer is None else f"{row.peer:.3f}"
        ratio = "–" if row.peer is None else f"{row.peer / row.ours:.2f}"
        lines.append(f"| {row.scenario} | {row.ours:.3f} | {peer} | {ratio} | {row.beside} |")
    return "\n".join(lines)


def main() -> None:
    rows = kernel()
    rows += frame_and_bind("biped", build_biped)
    rows += frame_and_bind("bar", lambda: long_bar(400, 25))
    rows += posed_drag() + idle()
    text = f"Blender {bpy.app.version_string}, medians of {ROUNDS} rounds in one process\n\n{table(rows)}\n"
    print(text)
    target = Path("build/bench.md")
    target.parent.mkdir(exist_ok=True)
    target.write_text(text)


if __name__ == "__main__":
    main()
