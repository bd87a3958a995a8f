"""Undo and redo: what comes back is what was there, on every part of the rig."""

from __future__ import annotations

import random
from collections.abc import Callable

import bmesh
import bpy
import numpy as np
import pytest
from scene import (
    Rig,
    bend,
    bound_bar,
    drag,
    edited,
    enter_edit_mode,
    fresh,
    leave_edit_mode,
    rest,
    select,
    set_mesh,
    shown,
    update,
)


def push(name: str) -> None:
    """What the end of an operator does."""
    bpy.ops.ed.undo_push(message=name)


def current() -> Rig:
    """The rig after an undo: Blender has made every object anew."""
    cage = bpy.data.objects["BarCage"]
    return Rig([bpy.data.objects["Bar"]], bpy.data.objects["BarRig"], cage)


def state() -> dict[str, np.ndarray]:
    rig = current()
    update()
    posed, cage = rig.posed, rig.cage
    return {
        "skin": shown(rig.skin).copy(),
        "posed": edited(posed) if posed.data.is_editmode else rest(posed),
        "cage": rest(cage) if cage.data.is_editmode else shown(cage).copy(),
        "refit": np.array([bone.matrix for bone in rig.refit.pose.bones]),
    }


def assert_same(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray], *, tolerance: float = 5e-6) -> None:
    for name, points in wanted.items():
        error = np.abs(found[name] - points).max()
        assert error < tolerance, f"{name} differs by {error}"


@pytest.fixture
def undoable() -> Rig:
    push("start")
    rig = bound_bar()
    push("bind")
    return rig


def edit_pose(rig: Rig, amount: float) -> None:
    bend(rig, amount)


def edit_rest(rig: Rig, amount: float) -> None:
    points = rest(rig.cage)
    points[9:13, 1:] *= 1.0 + 0.2 * amount
    set_mesh(rig.cage, points)


def edit_posed(rig: Rig, amount: float) -> None:
    points = rest(rig.posed)
    points[17] += (0.05 * amount, 0.02, -0.03 * amount)
    set_mesh(rig.posed, points)


EDITS = {"pose": edit_pose, "rest": edit_rest, "posed": edit_posed}


def test_undo_and_redo_of_every_edit(undoable: Rig) -> None:
    states = [state()]
    for name in ("pose", "rest", "posed", "pose", "posed", "rest"):
        EDITS[name](current(), 0.5 + 0.1 * len(states))
        push(name)
        states.append(state())
    for wanted in reversed(states[:-1]):
        bpy.ops.ed.undo()
        assert_same(state(), wanted)
    for wanted in states[1:]:
        bpy.ops.ed.redo()
        assert_same(state(), wanted)
    assert current().settings.state == "LIVE"


def test_undo_of_the_bind(undoable: Rig) -> None:
    bend(undoable, 0.7)
    push("bend")
    live = state()
    bpy.ops.ed.undo()
    bpy.ops.ed.undo()
    assert "BarCage" not in bpy.data.objects
    bpy.ops.ed.redo()
    bpy.ops.ed.redo()
    assert_same(state(), live)
    assert current().settings.state == "LIVE"


def test_undo_of_a_rebind(undoable: Rig) -> None:
    edit_pose(undoable, 0.7)
    push("bend")
    wanted = state()
    rig = current()
    skin, cage = rig.skin, rig.cage
    set_mesh(skin, rest(skin) * np.float32([1, 0.5, 0.5]))
    set_mesh(cage, rest(cage) * np.float32([1, 0.7, 0.7]))
    select([cage], cage)
    bpy.ops.cage_rig.rebind()
    push("rebind")
    rebound = state()
    bpy.ops.ed.undo()
    assert_same(state(), wanted)
    bpy.ops.ed.redo()
    assert_same(state(), rebound)


def test_undo_in_edit_mode_of_the_posed_cage_brings_the_rest_cage_back(undoable: Rig) -> None:
    bend(undoable, 1.0)
    push("bend")
    enter_edit_mode(undoable.posed)
    push("edit mode")
    states = [state()]
    for step in range(3):
        drag(current().posed, 14, (0.0, 0.05, 0.01 * step))
        push("drag")
        states.append(state())
    assert np.abs(states[-1]["cage"] - states[0]["cage"]).max() > 0.05
    for wanted in reversed(states[:-1]):
        bpy.ops.ed.undo()
        assert_same(state(), wanted)
    for wanted in states[1:]:
        bpy.ops.ed.redo()
        assert_same(state(), wanted)
    leave_edit_mode()
    assert_same(state(), states[-1])


def test_undo_in_edit_mode_after_the_frame_changed(undoable: Rig) -> None:
    """The rest cage comes back as it was; the posed cage is that of the new frame."""
    bone = undoable.armature.pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.2), (20, 1.4)):
        bone.rotation_euler = (0, 0, angle)
        bone.keyframe_insert("rotation_euler", frame=frame)
    scene = bpy.context.scene
    scene.frame_set(20)
    late = state()
    scene.frame_set(1)
    push("keys")
    enter_edit_mode(undoable.posed)
    push("edit mode")
    early = state()
    drag(current().posed, 14, (0.0, 0.1, 0.05))
    push("drag")
    dragged = state()
    bpy.context.scene.frame_set(20)
    bpy.ops.ed.undo()
    assert_same(state(), late)
    bpy.context.scene.frame_set(1)
    assert_same(state(), early)
    bpy.ops.ed.redo()
    assert_same(state(), dragged)


def test_undo_in_edit_mode_to_a_step_saved_before_the_rig_followed(undoable: Rig) -> None:
    """A script's operator in Edit Mode saves its undo step before the update in which the rest cage follows."""
    bend(undoable, 1.0)
    push("bend")
    enter_edit_mode(undoable.posed)
    push("edit mode")
    edit = bmesh.from_edit_mesh(undoable.posed.data)
    edit.verts.ensure_lookup_table()
    edit.verts[14].co.y += 0.1
    bmesh.update_edit_mesh(undoable.posed.data)
    push("moved, not updated yet")
    wanted = state()
    drag(current().posed, 9, (0.1, 0.0, 0.0))
    push("drag")
    bpy.ops.ed.undo()
    assert_same(state(), wanted)


def test_undo_to_a_step_that_was_saved_before_the_rig_followed(undoable: Rig) -> None:
    """An operator's undo step is saved when it ends, before the update in which the posed cage follows."""
    bend(undoable, 1.0)
    points = rest(undoable.cage)
    points[9:13, 1:] *= 1.5
    undoable.cage.data.vertices.foreach_set("co", points.ravel())
    undoable.cage.data.update()
    push("rest cage, not updated yet")
    wanted = state()
    assert np.abs(wanted["cage"] - points).max() < 1e-6
    edit_pose(current(), -0.5)
    push("pose")
    bpy.ops.ed.undo()
    assert_same(state(), wanted)
    bpy.ops.ed.redo()
    bpy.ops.ed.undo()
    assert_same(state(), wanted)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_edits_and_undos_equal_a_fresh_computation(undoable: Rig, seed: int) -> None:
    chance = random.Random(seed)
    states, at = [state()], 0
    for _ in range(40):
        if chance.random() < 0.35 and at > 0:
            bpy.ops.ed.undo()
            at -= 1
        elif chance.random() < 0.3 and at < len(states) - 1:
            bpy.ops.ed.redo()
            at += 1
        else:
            name = chance.choice(sorted(EDITS))
            EDITS[name](current(), chance.uniform(-1.0, 1.0))
            push(name)
            at += 1
            states[at:] = [state()]
        assert_same(state(), states[at])
    live = state()["skin"]
    assert np.abs(fresh(current())[0] - live).max() < 5e-6


def edit_frame(_rig: Rig, amount: float) -> None:
    bpy.context.scene.frame_set(int(10 + 9 * amount))


def edit_method(rig: Rig, amount: float) -> None:
    rig.settings.method = ("LBS", "DQS")[amount > 0]
    update()


def edit_influence(rig: Rig, amount: float) -> None:
    rig.settings.influence = 1.0 - 0.4 * abs(amount)
    update()


def key_with(name: str) -> Callable[[Rig, float], None]:
    def press(rig: Rig, _amount: float) -> None:
        select([rig.cage], rig.cage)
        getattr(bpy.ops.cage_rig, name)()
        update()

    return press


KEYED_EDITS = {
    "posed": edit_posed,
    "pose": edit_pose,
    "frame": edit_frame,
    "method": edit_method,
    "influence": edit_influence,
    **{name: key_with(name) for name in ("key_cage", "key_envelope", "delete_key", "discard_edit")},
}


@pytest.mark.parametrize("seed", [1, 2])
def test_two_hundred_random_edits_keys_and_undos(undoable: Rig, seed: int) -> None:
    """Edits of a keyed cage and of bones, frames, keys and settings, undone and redone in any order."""
    chance = random.Random(seed)
    states, at = [state()], 0
    for _ in range(200):
        draw = chance.random()
        if draw < 0.25 and at > 0:
            bpy.ops.ed.undo()
            at -= 1
        elif draw < 0.4 and at < len(states) - 1:
            bpy.ops.ed.redo()
            at += 1
        else:
            name = chance.choice(sorted(KEYED_EDITS))
            KEYED_EDITS[name](current(), chance.uniform(-1.0, 1.0))
            push(name)
            at += 1
            states[at:] = [state()]
        assert_same(state(), states[at], tolerance=2e-5)
        assert current().settings.state == "LIVE", current().settings.message
    live = state()["skin"]
    assert np.abs(fresh(current())[0] - live).max() < 1e-5


def act_in_edit_mode(objects: list[bpy.types.Object], chance: random.Random) -> None:
    if chance.random() < 0.3:
        leave_edit_mode()
    else:
        offset = (chance.uniform(-0.1, 0.1), chance.uniform(-0.1, 0.1), 0.0)
        drag(chance.choice(objects), chance.randrange(28), offset)


def act_in_object_mode(rig: Rig, chance: random.Random) -> None:
    name = chance.choice(["pose", "rest", "posed", "enter posed", "enter rest", "enter both"])
    if name in EDITS:
        EDITS[name](rig, chance.uniform(-1.0, 1.0))
        return
    entered = {"enter posed": [rig.posed], "enter rest": [rig.cage], "enter both": [rig.posed, rig.cage]}[name]
    enter_edit_mode(*entered)
    update()


@pytest.mark.parametrize("seed", [1, 2])
def test_random_edits_modes_and_undos_equal_what_was_there(undoable: Rig, seed: int) -> None:
    chance = random.Random(seed)
    states, at = [state()], 0
    for _ in range(200):
        draw = chance.random()
        if draw < 0.3 and at > 0:
            bpy.ops.ed.undo()
            at -= 1
        elif draw < 0.45 and at < len(states) - 1:
            bpy.ops.ed.redo()
            at += 1
        else:
            rig = current()
            in_edit_mode = [obj for obj in (rig.posed, rig.cage) if obj.data.is_editmode]
            if in_edit_mode:
                act_in_edit_mode(in_edit_mode, chance)
            else:
                act_in_object_mode(rig, chance)
            push("act")
            at += 1
            states[at:] = [state()]
        assert_same(state(), states[at], tolerance=2e-5)
        assert current().settings.state == "LIVE", current().settings.message
    if any(obj.data.is_editmode for obj in (current().posed, current().cage)):
        leave_edit_mode()
    live = state()["skin"]
    assert np.abs(fresh(current())[0] - live).max() < 5e-6
