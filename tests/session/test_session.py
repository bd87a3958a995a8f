"""The session, without Blender: `addon/session.py` knows no bpy and runs anywhere."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from blend_fixtures.bar import bar

ROOT = Path(__file__).parent.parent.parent


@pytest.fixture(scope="module")
def session() -> ModuleType:
    spec = importlib.util.spec_from_file_location("cage_rig_session", ROOT / "addon/session.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def faces_of(rows: object) -> tuple[np.ndarray, np.ndarray]:
    rows = [list(row) for row in rows]
    return np.concatenate(rows).astype(np.int32), np.array([len(row) for row in rows], np.int32)


def csr(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    row, column = np.nonzero(weights)
    indptr = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=len(weights)))])
    return indptr, column, weights[row, column].astype(np.float32).astype(np.float64)


@pytest.fixture
def snapshot(session: ModuleType) -> object:
    character = bar()
    skin, cage, bones = character.skins[0], character.cage, character.bones
    part = session.SkinSnapshot(np.float32(skin.vertices), faces_of(skin.faces), csr(skin.weights))
    second = session.SkinSnapshot(np.float32(skin.vertices * 0.9), faces_of(skin.faces), csr(skin.weights))
    return session.Snapshot(
        [part, second],
        np.array([bone.head for bone in bones], float),
        np.array([bone.tail for bone in bones], float),
        np.array([-1, 0], np.int32),
        np.float32(cage.vertices),
        faces_of(cage.faces),
        "lbs",
    )


@pytest.fixture
def live(session: ModuleType, snapshot: object) -> object:
    return session.Session(snapshot)


def bend(snapshot: object, angle: float) -> np.ndarray:
    """Transforms of the bar with its second bone turned about z at its head."""
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    turn[:3, 3] = snapshot.heads[1] - turn[:3, :3] @ snapshot.heads[1]
    return np.stack([np.eye(4), turn])


def test_rest_is_rest(live: object, snapshot: object) -> None:
    live.play(snapshot.cage, bend(snapshot, 0.0), snapshot.heads)
    for k, skin in enumerate(snapshot.skins):
        assert np.abs(live.posed_skin(k) - skin.points).max() < 1e-6
    assert np.abs(live.posed_cage() - snapshot.cage).max() < 1e-6


def test_two_skins_are_posed_like_one_each(live: object, session: ModuleType, snapshot: object) -> None:
    transforms = bend(snapshot, 1.0)
    live.play(snapshot.cage, transforms, snapshot.heads)
    for k, skin in enumerate(snapshot.skins):
        indptr, columns, values = skin.weights
        dense = np.zeros((len(skin.points), 2))
        dense[np.repeat(np.arange(len(dense)), np.diff(indptr)), columns] = values
        dense /= dense.sum(1, keepdims=True)
        points = np.c_[skin.points, np.ones(len(dense))]
        wanted = np.einsum("mj,jrc,mc->mr", dense, transforms[:, :3], points)
        assert np.abs(live.posed_skin(k) - wanted).max() < 2e-6 * live.size


def test_the_same_input_does_no_work(live: object, snapshot: object) -> None:
    transforms = bend(snapshot, 1.0)
    live.play(snapshot.cage, transforms, snapshot.heads)
    live.posed_skin(0), live.posed_cage()
    before, work = live.revision, dict(live.rig.work)
    for _ in range(3):
        live.play(snapshot.cage.copy(), transforms.copy(), snapshot.heads.copy())
        live.offset_skins([None, None])
    assert live.revision == before and dict(live.rig.work) == work


def test_posed_edit_lands(live: object, snapshot: object) -> None:
    live.play(snapshot.cage, bend(snapshot, 1.2), snapshot.heads)
    wanted = live.posed_cage().copy()
    wanted[9] += (0.1, 0.2, 0.0)
    live.edit_posed_cage(wanted)
    assert np.abs(live.posed_cage() - wanted).max() < 1e-6


def test_influence_scales_the_cage_and_a_posed_edit_still_lands(live: object, snapshot: object) -> None:
    fat = snapshot.cage * np.float32([1.0, 1.5, 1.5])
    transforms = bend(snapshot, 0.7)
    live.play(snapshot.cage + (fat - snapshot.cage) * np.float32(0.5), transforms, snapshot.heads)
    half = live.posed_skin(0).copy()
    live.play(fat, transforms, snapshot.heads, 0.5)
    assert np.abs(live.posed_skin(0) - half).max() < 1e-6
    wanted = live.posed_cage().copy()
    wanted[9] += (0.1, 0.2, 0.0)
    cage = live.edit_posed_cage(wanted)
    live.play(np.float32(cage), transforms, snapshot.heads, 0.5)
    assert np.abs(live.posed_cage() - wanted).max() < 2e-6


def test_no_influence_refuses_a_posed_edit(live: object, session: ModuleType, snapshot: object) -> None:
    live.play(snapshot.cage, bend(snapshot, 0.7), snapshot.heads, 0.0)
    with pytest.raises(session.SessionError, match="influence is 0"):
        live.edit_posed_cage(live.posed_cage() + 0.1)


def test_offsets_move_the_visible_skin_only(live: object, snapshot: object) -> None:
    live.play(snapshot.cage, bend(snapshot, 0.0), snapshot.heads)
    posed = live.posed_cage().copy()
    offset = np.zeros_like(snapshot.skins[0].points)
    offset[:10, 2] = 0.25
    live.offset_skins([offset, None])
    assert np.abs(live.posed_skin(0) - snapshot.skins[0].points - offset).max() < 1e-6
    assert np.abs(live.posed_skin(1) - snapshot.skins[1].points).max() < 1e-6
    assert np.array_equal(live.posed_cage(), posed)


def test_refit_bones_reach_their_children(live: object, snapshot: object) -> None:
    stretched = snapshot.cage * np.float32([1.5, 1, 1])
    live.play(stretched, bend(snapshot, 0.0), snapshot.heads)
    rest = np.stack([np.array([[0, -1, 0, x], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], float) for x in (-1, 0)])
    rest[:, :3, :3] = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], float)  # bones along x
    posed = rest @ live.refit_pose(live.refit_bones(rest))
    assert np.allclose(posed[:, :3, 3], [[-1.5, 0, 0], [0, 0, 0]], atol=1e-6)
    assert np.allclose(posed[0] @ [0, 1.0, 0, 1], [0, 0, 0, 1], atol=1e-6)


def test_a_playback_shows_what_the_session_has_whoever_moved_it(
    live: object, session: ModuleType, snapshot: object
) -> None:
    rest = np.tile(np.eye(4), (2, 1, 1))
    rest[:, :3, 3] = snapshot.heads
    bones, refit = session.bones(rest), live.refit_bones(rest)
    other = session.Session(snapshot)
    playback = session.Playback(live, bones, refit)
    playback.cage[:] = snapshot.cage * np.float32(1.1)
    for angle in (0.2, 0.7):
        posed = bend(snapshot, angle) @ rest
        playback.bones[:] = posed.transpose(0, 2, 1)
        playback.play(0.5, fitted=True, again=False)
        other.play_posed(playback.cage, bones, np.float32(posed), 0.5)
        for k in range(2):
            assert np.array_equal(live.posed_skin(k), other.posed_skin(k))
        assert np.array_equal(playback.posed_cage, other.posed_cage())
        assert np.array_equal(playback.refit_pose.transpose(0, 2, 1), np.float32(other.refit_pose(refit)))
    before, work = live.revision, dict(live.rig.work)
    playback.play(0.5, fitted=True, again=False)
    assert (live.revision, dict(live.rig.work)) == (before, work)
    offset = np.full_like(snapshot.skins[0].points, 0.25)
    for each in (live, other):
        each.offset_skins([offset, None])
    playback.play(0.5, fitted=True, again=False)
    assert np.array_equal(live.posed_skin(0), other.posed_skin(0))
    live.play(snapshot.cage, bend(snapshot, 0.0), snapshot.heads)
    assert np.abs(live.posed_skin(1) - snapshot.skins[1].points).max() < 1e-6


def test_a_refusal_of_the_core_is_a_session_error(session: ModuleType, snapshot: object) -> None:
    broken = session.Snapshot(**{**vars(snapshot), "cage": snapshot.cage * np.float32(np.nan)})
    with pytest.raises(session.SessionError, match="cage"):
        session.Session(broken)


def test_a_refused_input_leaves_the_session_as_it_was(live: object, session: ModuleType, snapshot: object) -> None:
    live.play(snapshot.cage, bend(snapshot, 1.0), snapshot.heads)
    before = live.posed_skin(0).copy()
    spoiled = bend(snapshot, 0.5)
    spoiled[1, 0, 0] = np.inf
    with pytest.raises(session.SessionError):
        live.play(snapshot.cage, spoiled, snapshot.heads)
    assert np.array_equal(live.posed_skin(0), before)


def test_a_panic_of_the_core_is_a_session_crash(
    live: object, session: ModuleType, snapshot: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Panicking:
        def play(self, *_: object) -> None:
            raise session.cage_rig_core.PanicException("index out of bounds")

    monkeypatch.setattr(live, "rig", Panicking())
    with pytest.raises(session.SessionCrash, match="index out of bounds"):
        live.play(snapshot.cage, bend(snapshot, 1.0), snapshot.heads)


def test_masks_and_offsets_of_one_skin_leave_the_other(live: object, snapshot: object) -> None:
    live.play(snapshot.cage * np.float32([1, 1.5, 1.5]), bend(snapshot, 0.0), snapshot.heads)
    before = [live.posed_skin(k).copy() for k in range(2)]
    live.mask_skins([None, np.zeros(len(snapshot.skins[1].points), np.float32)])
    assert np.array_equal(live.posed_skin(0), before[0])
    assert np.abs(live.posed_skin(1) - snapshot.skins[1].points).max() < 1e-6
    revision = live.revision
    live.mask_skins([None, np.zeros(len(snapshot.skins[1].points), np.float32)])
    assert live.revision == revision, "the same mask is no change"
    live.mask_skins([None, None])
    assert np.array_equal(live.posed_skin(1), before[1])


def test_a_session_stands_on_another_and_follows_it(session: ModuleType, snapshot: object) -> None:
    lower, upper = session.Session(snapshot), session.Session(snapshot)
    transforms = bend(snapshot, 0.8)
    fat = snapshot.cage * np.float32([1.3, 1.5, 1.5])
    lower.play(fat, transforms, snapshot.heads)
    upper.play(snapshot.cage, transforms, snapshot.heads)
    below = session.Below(lower, [0, -1], np.arange(2))
    upper.stand_on(below)
    assert np.abs(upper.posed_skin(0) - lower.posed_skin(0)).max() < 2e-6
    assert np.abs(upper.joints - lower.joints).max() < 1e-12
    assert np.abs(upper.cage_movement() - (fat - snapshot.cage)).max() < 1e-6
    assert np.abs(upper.skin_movement(0) - lower.skin_movement(0)).max() < 1e-6
    assert np.abs(upper.skin_movement(1)).max() == 0.0, "the lower one does not have this skin"
    revision = upper.revision
    upper.stand_on(below)
    assert upper.revision == revision, "nothing has changed below"
    lower.play(snapshot.cage, transforms, snapshot.heads)
    upper.stand_on(below)
    alone = session.Session(snapshot)
    alone.play(snapshot.cage, transforms, snapshot.heads)
    assert np.abs(upper.posed_skin(0) - alone.posed_skin(0)).max() < 2e-6
    upper.stand_on(None)
    assert np.abs(upper.posed_skin(0) - alone.posed_skin(0)).max() < 2e-6
