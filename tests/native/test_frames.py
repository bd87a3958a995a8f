"""Frames: drags by columns, several at once, other instructions and 16-bit weights."""

import cage_rig_core as core
import numpy as np
import pytest


def frames_of(bar, bent, count):
    """Cages and transforms of an animation."""
    waves = np.sin(np.arange(count)[:, None, None] + np.arange(48).reshape(16, 3))
    transforms = np.tile(np.eye(4), (count, 2, 1, 1))
    share = np.linspace(0, 1, count)[:, None, None]
    transforms[:, 1] += share * (bent[1] - np.eye(4))
    return bar["cage_vertices"] + 0.1 * waves, transforms


def played(rig, cage, transforms):
    rig.play(cage, transforms)
    return rig.posed_skin.astype(np.float32)


@pytest.mark.parametrize("method", core.skinning_methods())
def test_several_frames_at_once_are_what_playing_them_gives(bar, bent, method):
    rig, other = core.CoupledRig(**bar, method=method), core.CoupledRig(**bar, method=method)
    cages, transforms = frames_of(bar, bent, 6)
    found = rig.posed_skins(cages, transforms)
    assert found.dtype == np.float32 and found.shape == (6, len(bar["skin_vertices"]), 3)
    for frame, cage, pose in zip(found, cages, transforms, strict=True):
        np.testing.assert_array_equal(frame, played(other, cage, pose))
    still = rig.posed_skins(cages[2], transforms)
    for frame, pose in zip(still, transforms, strict=True):
        np.testing.assert_array_equal(frame, played(other, cages[2], pose))
    np.testing.assert_array_equal(rig.rest_cage, bar["cage_vertices"])
    assert rig.work["rest_passes"] == 3
    assert rig.posed_skins(cages[:0], transforms[:0]).shape == (0, len(bar["skin_vertices"]), 3)


def test_frames_that_do_not_fit_are_refused_by_name(bar, bent):
    rig = core.CoupledRig(**bar)
    cages, transforms = frames_of(bar, bent, 4)
    with pytest.raises(core.ArrayError, match=r"cages must be \(4, 16, 3\)"):
        rig.posed_skins(cages[:3], transforms)
    with pytest.raises(core.ArrayError, match=r"transforms must be \(#F, 2, 4, 4\)"):
        rig.posed_skins(cages, transforms[0])
    sheared = transforms.copy()
    sheared[3, 1, 3, 0] = 0.5
    with pytest.raises(core.PoseError, match="joint 1"):
        rig.posed_skins(cages, sheared)


def test_a_drag_reads_the_columns_that_move(bar):
    rig = core.CoupledRig(**bar)
    cage = bar["cage_vertices"].copy()
    for _step in range(50):
        cage[5] += [0.01, 0.02, -0.01]
        rig.edit_rest_cage(cage)
        expected = bar["skin_vertices"] + rig.cage_coords @ (cage - bar["cage_vertices"])
        np.testing.assert_allclose(rig.rest_skin, expected, atol=1e-6 * rig.size)
    assert rig.work["rest_passes"] == rig.work["rest_column_passes"] == 50


def test_frames_can_be_reproducible(bar, bent):
    bound, key = bar["cage_vertices"], bar["cage_vertices"] * [1.0, 1.3, 0.8]
    fast, same = core.CoupledRig(**bar), core.CoupledRig(**bar)
    assert not same.reproducible
    same.reproducible = True
    for frame in range(12):
        cage = bound + (key - bound) * (frame / 12)
        for rig in (fast, same):
            rig.play(cage, bent)
        fresh = core.CoupledRig(**bar)
        fresh.play(cage, bent)
        assert np.array_equal(same.posed_skin, fresh.posed_skin)
        np.testing.assert_allclose(fast.posed_skin, fresh.posed_skin, atol=1e-6 * fast.size)
    cage[3] += [0.01, 0.0, 0.0]
    for rig in (fast, same):
        rig.play(cage, bent)
        assert np.isfinite(rig.posed_skin).all()
    assert (fast.work["rest_column_passes"], same.work["rest_column_passes"]) == (1, 0)


def test_instructions_can_be_forced_and_agree(bar, bent):
    cages, transforms = frames_of(bar, bent, 2)
    expected = played(core.CoupledRig(**bar), cages[1], transforms[1])
    baseline = core.CoupledRig(**bar, options={"instructions": "baseline"})
    size = baseline.size
    assert np.abs(played(baseline, cages[1], transforms[1]) - expected).max() <= 1e-6 * size
    with pytest.raises(core.CageRigError, match='no instructions named "abacus"; it has baseline'):
        core.CoupledRig(**bar, options={"instructions": "abacus"})


def test_16_bit_weights_stay_near(bar, bent):
    cages, transforms = frames_of(bar, bent, 3)
    rigs = [core.CoupledRig(**bar, options={"half_weights": half}) for half in (False, True)]
    single, half = (played(rig, cages[2], transforms[2]) for rig in rigs)
    moved = np.abs(cages[2] - bar["cage_vertices"]).max()
    assert 0 < np.abs(half - single).max() <= 2e-4 * moved + 1e-6 * rigs[0].size
    np.testing.assert_allclose(rigs[1].cage_coords, rigs[0].cage_coords, atol=0)
    assert [rig.half_weights for rig in rigs] == [False, True]
    rigs[0].half_weights = True
    np.testing.assert_array_equal(played(rigs[0], cages[2], transforms[2]), half)
