"""Corrections with drivers and physics on the rest cage: in playback, render and bake."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from baked import bake, worst
from scene import Points, Rig, bind, drag, enter_edit_mode, fresh, leave_edit_mode, native, rest, shown
from test_sync import assert_rendered

from blend_fixtures.corrections import BULGE, CORRECTIONS, LAST_FRAME

PHYSICS = ("jiggling", "fluttering")


def play(rig: Rig) -> dict[int, Points]:
    """The skin at every frame, played from the first one on as physics wants it."""
    found = {}
    for frame in range(1, LAST_FRAME + 1):
        bpy.context.scene.frame_set(frame)
        found[frame] = shown(rig.skin).copy()
    return found


@pytest.fixture(params=CORRECTIONS)
def corrected(request: pytest.FixtureRequest) -> Rig:
    rig = bind(CORRECTIONS[request.param]())
    assert rig.settings.state == "LIVE", rig.settings.message
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, LAST_FRAME
    return rig


def test_corrections_play_the_same_again_and_are_what_a_fresh_rig_computes(corrected: Rig) -> None:
    first, again = play(corrected), play(corrected)
    assert max(np.abs(first[frame] - again[frame]).max() for frame in first) < 1e-6
    assert np.abs(shown(corrected.skin) - native(corrected.skin)).max() > 5e-3, "the cage does something"
    assert np.abs(shown(corrected.skin) - fresh(corrected)[0]).max() < 1e-6


def test_corrections_render(corrected: Rig, tmp_path: Path) -> None:
    if corrected.cage.modifiers:
        bpy.ops.ptcache.bake_all(bake=True)
    corrected.armature.rotation_euler.x -= 0.5 * np.pi  # the camera looks down; the elbow bends upward
    truth = play(corrected)
    assert_rendered(corrected, truth, tmp_path)


def test_corrections_bake(corrected: Rig, tmp_path: Path) -> None:
    if corrected.cage.modifiers:
        bpy.ops.ptcache.bake_all(bake=True)
    copies = bake().to_shape_keys(corrected.cage, frame_start=1, frame_end=LAST_FRAME)
    assert worst(corrected, copies.skins, range(1, LAST_FRAME + 1, 4)) < 1e-5


def test_the_biceps_swells_with_the_elbow_and_takes_edits() -> None:
    rig = bind(CORRECTIONS["driven_biceps"]())
    scene = bpy.context.scene
    scene.frame_set(1)
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 5e-5  # the angle is not quite 0 in single precision
    scene.frame_set(LAST_FRAME)
    swollen = np.abs(shown(rig.skin) - native(rig.skin)).max()
    assert swollen > 5e-3
    # The artist sculpts the bulge in the pose in which it shows.
    rig.cage.active_shape_key_index = rig.cage.data.shape_keys.key_blocks.find(BULGE)
    enter_edit_mode(rig.posed)
    drag(rig.posed, 9, (0.0, 0.0, 0.05))
    leave_edit_mode()
    wanted = rest(rig.posed)
    assert rig.settings.message == "", rig.settings.message
    scene.frame_set(1)
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 5e-5, "nothing of it at rest"
    scene.frame_set(LAST_FRAME)
    assert np.abs(rest(rig.posed) - wanted).max() < 1e-5
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() > swollen


@pytest.mark.parametrize("name", PHYSICS)
def test_physics_lags_behind_the_motion(name: str) -> None:
    rig = bind(CORRECTIONS[name]())
    play(rig)
    moved = shown(rig.cage) - rest(rig.cage)
    assert 0.01 < np.abs(moved).max() < 1.0, "a jiggle, not an explosion"
    enter_edit_mode(rig.posed)
    drag(rig.posed, 3, (0.0, 0.0, 0.1))
    assert "deforms the rest cage" in rig.settings.message
    leave_edit_mode()
