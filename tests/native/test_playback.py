"""Frames from arrays into arrays are what playing them and asking for the results gives."""

import cage_rig_core as core
import numpy as np
import pytest


@pytest.fixture
def rest(bar):
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[:, :3, 3] = bar["joints"]
    return matrices


@pytest.fixture
def arrays(bar, rest):
    return {
        "cage": np.float32(bar["cage_vertices"] * 1.2),
        "posed": np.float32(rest).transpose(0, 2, 1).copy().transpose(0, 2, 1),
        "skin": np.zeros((len(bar["skin_vertices"]), 3), np.float32),
        "posed_cage": np.zeros((16, 3), np.float32),
        "refit_pose": np.zeros((2, 4, 4), np.float32),
    }


def assert_shown(arrays, rig, refit):
    np.testing.assert_array_equal(arrays["skin"], rig.posed_skin.astype(np.float32))
    np.testing.assert_array_equal(arrays["posed_cage"], rig.posed_cage.astype(np.float32))
    np.testing.assert_array_equal(arrays["refit_pose"], rig.refit_pose(refit).astype(np.float32))


@pytest.mark.parametrize("method", core.skinning_methods())
def test_frames_show_what_playing_them_gives(bar, bent, rest, arrays, method):
    rig, other = core.CoupledRig(**bar, method=method), core.CoupledRig(**bar, method=method)
    bones, refit = core.Bones(rest), core.Bones(rest, [[0, 1]], [4.8])
    playback = core.Playback(rig, bones, refit, **arrays)
    for share in (0.0, 0.4, 1.0):
        arrays["posed"][1] = (np.eye(4) + share * (bent[1] - np.eye(4))) @ rest[1]
        assert playback.play() and not playback.play()
        assert other.play_posed(arrays["cage"], bones, arrays["posed"])
        assert_shown(arrays, other, refit)
    assert rig.work["skin_passes"] == rig.work["cage_fits"] == 3
    np.testing.assert_array_equal(rig.posed_skin, other.posed_skin)


def test_part_of_the_movement_is_that_part_of_it(bar, rest, arrays):
    rig, other = core.CoupledRig(**bar), core.CoupledRig(**bar)
    core.Playback(rig, core.Bones(rest), **arrays).play(0.3)
    base = bar["cage_vertices"]
    other.play_posed(base + 0.3 * (arrays["cage"] - base), core.Bones(rest), arrays["posed"])
    np.testing.assert_array_equal(arrays["skin"], other.posed_skin.astype(np.float32))


def test_a_posed_cage_is_fitted_where_it_is_asked_for_and_shown_again_on_request(bar, rest, arrays):
    rig = core.CoupledRig(**bar)
    playback = core.Playback(rig, core.Bones(rest), **arrays)
    assert playback.play(fitted=False)
    assert not arrays["posed_cage"].any() and rig.work["cage_fits"] == 0
    assert not arrays["refit_pose"].any(), "no refit bones were named"
    assert not playback.play(fitted=True) and not arrays["posed_cage"].any()
    assert not playback.play(fitted=True, again=True)
    np.testing.assert_array_equal(arrays["posed_cage"], rig.posed_cage.astype(np.float32))


def test_arrays_that_do_not_fit_are_refused_by_name(bar, rest, arrays):
    rig, bones = core.CoupledRig(**bar), core.Bones(rest)
    wrong = {
        "cage": arrays["cage"].astype(float),
        "posed": arrays["posed"][:1],
        "skin": arrays["skin"][:, :2],
        "posed_cage": arrays["posed_cage"].tolist(),
        "refit_pose": np.zeros((2, 4, 3), np.float32),
    }
    for name, array in wrong.items():
        with pytest.raises(ValueError, match=f"^{name} must be"):
            core.Playback(rig, bones, **{**arrays, name: array})
    with pytest.raises(ValueError, match="skin must be contiguous"):
        core.Playback(rig, bones, **{**arrays, "skin": np.asfortranarray(arrays["skin"])})
    with pytest.raises(ValueError, match="the rig has 2 joints, these are 1 bones"):
        core.Playback(rig, core.Bones(rest[:1]), **arrays)


def test_a_frame_that_is_refused_leaves_what_was_shown(bar, rest, arrays):
    playback = core.Playback(core.CoupledRig(**bar), core.Bones(rest), **arrays)
    playback.play()
    before = arrays["skin"].copy()
    arrays["cage"][4] = np.nan
    with pytest.raises(ValueError, match="cage has a value that is not finite or beyond 1e12 in row 4"):
        playback.play()
    arrays["cage"][4], arrays["posed"][1, 3] = 0.0, 1.0
    with pytest.raises(ValueError, match="joint 1"):
        playback.play()
    arrays["posed"][1, 3] = 0.0, 0.0, 0.0, 1.0
    arrays["skin"].flags.writeable = False
    with pytest.raises(ValueError, match="writable"):
        playback.play()
    np.testing.assert_array_equal(arrays["skin"], before)
