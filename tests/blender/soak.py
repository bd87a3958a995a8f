"""A soak: random events on three rigs in one scene, which at any time equal a bind computed anew, in constant memory.

`make soak` runs ten thousand; `test_soak` a few hundred. As a script: soak.py EVENTS [SEED]
"""

from __future__ import annotations

import random
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from scene import (
    Points,
    Rig,
    bind,
    drag,
    enter_edit_mode,
    fresh,
    leave_edit_mode,
    rest,
    select,
    set_mesh,
    shown,
    update,
)

from blend_fixtures.build import build_character
from blend_fixtures.rigs import build_rig
from blend_fixtures.small import simple_bar, two_skins

TOLERANCE = 2e-5  # of what is shown from a fresh bind, relative to the size
EVERY = 25  # events between two comparisons
GROWTH = 64e6  # bytes that the process may grow by, once every kind of event has been met


class Soak:
    """The scene, the events, and what has to hold."""

    def __init__(self, seed: int, folder: Path) -> None:
        self.chance = random.Random(seed)
        self.path = folder / "soak.blend"
        self.met: dict[str, int] = {}
        self.faults: list[str] = []  # found by events themselves
        self.memory: list[int] = []  # bytes of the process after every tenth of the events
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.context.preferences.edit.undo_steps = 12
        self.names: list[tuple[list[str], str, str]] = []
        for build in (
            lambda: build_character(replace(simple_bar(), shape_keys={})),
            lambda: build_character(two_skins()),
            lambda: build_rig("keyed_locations"),
        ):
            rig = bind(build())
            for points in (rig.cage, rig.armature, *rig.skins):
                points.name = f"{len(self.names)} {points.name}"
            self.names.append(([skin.name for skin in rig.skins], rig.armature.name, rig.cage.name))
        bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 25
        self.push()

    def rig(self, index: int) -> Rig:
        """A rig by its names: undo and load make all objects anew."""
        skins, armature, cage = self.names[index]
        objects = bpy.data.objects
        return Rig([objects[name] for name in skins], objects[armature], objects[cage])

    def push(self) -> None:
        bpy.ops.ed.undo_push(message="soak")

    def run(self, events: int, tell: Callable[[str], object] = lambda _line: None) -> list[str]:
        """Let so many events happen; returns what was found wrong. `tell` gets a line after every tenth of them."""
        faults: list[str] = []
        names = list(EVENTS)
        begun = time.monotonic()
        for count in range(1, events + 1):
            name = self.chance.choice(names)
            self.met[name] = self.met.get(name, 0) + 1
            EVENTS[name](self, self.rig(self.chance.randrange(len(self.names))))
            update()
            if count % EVERY == 0 or count == events:
                faults += [f"after event {count} ({name}): {fault}" for fault in self.compare()]
            if count % max(1, events // 10) == 0:
                self.memory.append(resident())
                minutes = (time.monotonic() - begun) / 60.0
                tell(f"{count} events, {len(faults)} faults, {self.memory[-1] / 1e6:.0f} MB, {minutes:.1f} min")
        faults += self.faults
        grown = self.memory[-1] - self.memory[len(self.memory) * 2 // 5 - 1]
        if grown > GROWTH:
            faults.append(f"the process grew by {grown / 1e6:.0f} MB")
        return faults

    def compare(self) -> list[str]:
        """Every rig against a bind computed anew from the same file."""
        faults = []
        for index in range(len(self.names)):
            rig = self.rig(index)
            if rig.settings.state != "LIVE":
                faults.append(f"{rig.cage.name} is {rig.settings.state}: {rig.settings.message}")
                continue
            live = [shown(skin).copy() for skin in rig.skins]
            for skin, found, wanted in zip(rig.skins, live, fresh(rig), strict=True):
                error = float(np.abs(found - wanted).max()) / rig.size
                if not error <= TOLERANCE:
                    faults.append(f"{skin.name} is off by {error:.1e} of its size")
        return faults


def resident() -> int:
    """Bytes of memory that the process has now."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
    except OSError:  # not Linux: the most it ever had
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _rest_cage(soak: Soak, rig: Rig) -> None:
    keys = rig.cage.data.shape_keys
    points = (rig.cage.data.vertices if keys is None else keys.reference_key.data)[:]
    soak.chance.choice(points).co.z += soak.chance.uniform(-0.05, 0.05)
    rig.cage.data.update()
    update()
    soak.push()


def _posed_cage(soak: Soak, rig: Rig) -> None:
    points = rest(rig.posed)
    points[soak.chance.randrange(len(points))] += [soak.chance.uniform(-0.05, 0.05) for _ in range(3)]
    set_mesh(rig.posed, points)
    soak.push()


def _pose(soak: Soak, rig: Rig) -> None:
    bone = soak.chance.choice(list(rig.armature.pose.bones))
    bone.rotation_mode = "XYZ"
    bone.rotation_euler = [soak.chance.uniform(-0.8, 0.8) for _ in range(3)]
    soak.push()


def _frame(soak: Soak, _rig: Rig) -> None:
    bpy.context.scene.frame_set(soak.chance.randint(1, 25))


def _undo(soak: Soak, _rig: Rig) -> None:
    if bpy.ops.ed.undo.poll():
        bpy.ops.ed.undo()
        if soak.names[-1][2] not in bpy.data.objects:  # from before the characters were there
            bpy.ops.ed.redo()


def _redo(_soak: Soak, _rig: Rig) -> None:
    if bpy.ops.ed.redo.poll():
        bpy.ops.ed.redo()


def _save_and_load(soak: Soak, _rig: Rig) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(soak.path))
    bpy.ops.wm.open_mainfile(filepath=str(soak.path))
    soak.push()


def _delete_and_undo(soak: Soak, rig: Rig) -> None:
    soak.push()
    victim = soak.chance.choice([rig.posed, rig.cage, rig.armature, rig.refit, *rig.skins])
    bpy.data.objects.remove(victim)
    update()
    soak.push()
    bpy.ops.ed.undo()
    soak.push()  # or a redo would delete it again


def _edit_mode(soak: Soak, rig: Rig) -> None:
    obj = soak.chance.choice([rig.posed, rig.cage])
    enter_edit_mode(obj)
    for _ in range(3):
        drag(obj, soak.chance.randrange(len(obj.data.vertices)), (soak.chance.uniform(-0.05, 0.05), 0.0, 0.02))
    leave_edit_mode()
    soak.push()


def _setting(soak: Soak, rig: Rig) -> None:
    rig.settings.method = soak.chance.choice(("LBS", "DQS", "COR"))
    rig.settings.influence = soak.chance.choice((1.0, 1.0, 0.7))
    update()
    soak.push()


def _key(soak: Soak, rig: Rig) -> None:
    select([rig.cage], rig.cage)
    name = soak.chance.choice(("key_cage", "key_envelope", "delete_key", "discard_edit"))
    if getattr(bpy.ops.cage_rig, name).poll():
        getattr(bpy.ops.cage_rig, name)()
    update()
    soak.push()


def _rebind(soak: Soak, rig: Rig) -> None:
    select([rig.cage], rig.cage)
    bpy.ops.cage_rig.rebind()
    soak.push()


def _copy_and_delete(soak: Soak, rig: Rig) -> None:
    select([*rig.skins, rig.armature, rig.cage, rig.posed, rig.refit], rig.cage)
    bpy.ops.object.duplicate()
    update()
    bpy.ops.object.delete()
    update()
    bpy.data.orphans_purge()
    soak.push()


def _apply_transform(soak: Soak, rig: Rig) -> None:
    """Turn and scale an object and apply that (Ctrl A): the latter moves nothing. A scale of bones would: keyed places
    do not grow with them.
    """
    obj = soak.chance.choice([rig.cage, rig.armature, *rig.skins])
    obj.rotation_euler.z += soak.chance.uniform(-0.5, 0.5)
    if obj != rig.armature:
        obj.scale = obj.scale * soak.chance.choice((0.8, 1.25))
    update()
    soak.push()
    before = [in_world(skin) for skin in rig.skins]
    select([obj], obj)
    bpy.ops.object.transform_apply()
    soak.push()
    update()
    for skin, wanted in zip(rig.skins, before, strict=True):
        moved = float(np.abs(in_world(skin) - wanted).max()) / rig.size
        if not moved <= 0.02:  # vertices that lie in faces of the cage may be inside or outside after rounding
            soak.faults.append(f"{skin.name} moved by {moved:.1e} when the transform of {obj.name} was applied")


def in_world(obj: bpy.types.Object) -> Points:
    """Where a skin is shown."""
    matrix = np.array(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)
    return shown(obj) @ matrix[:3, :3].T + matrix[:3, 3]


def _envelope(soak: Soak, rig: Rig) -> None:
    """Back to the cage as it was bound, so that shapes do not wander off over thousands of events."""
    select([rig.cage], rig.cage)
    bpy.ops.cage_rig.key_envelope()
    soak.push()


EVENTS: dict[str, Callable[[Soak, Rig], None]] = {
    "rest cage": _rest_cage,
    "posed cage": _posed_cage,
    "pose": _pose,
    "frame": _frame,
    "undo": _undo,
    "redo": _redo,
    "save and load": _save_and_load,
    "delete and undo": _delete_and_undo,
    "edit mode": _edit_mode,
    "setting": _setting,
    "key": _key,
    "rebind": _rebind,
    "copy and delete": _copy_and_delete,
    "envelope": _envelope,
    "apply transform": _apply_transform,
}


def main() -> None:
    events, seed = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1
    with tempfile.TemporaryDirectory() as folder:
        soak = Soak(seed, Path(folder))
        faults = soak.run(events, lambda line: print(line, flush=True))
    for fault in faults[:20]:
        print(fault)
    print(f"{events} events, {len(faults)} faults: {soak.met}")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
