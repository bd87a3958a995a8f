"""Undo and redo: what comes back is what was there, on every part of the rig."""

from __future__ import annotations

import random

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
        "cage": rest(cage),
        "refit": np.array([bone.matrix for bone in rig.refit.pose.bones]),
    }


def assert_same(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> None:
    for name, points in wanted.items():
        assert np.abs(found[name] - points).max() < 5e-6, f"{name} differs by {np.abs(found[name] - points).max()}"


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
