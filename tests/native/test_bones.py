"""Bones as matrices: what an animation's are to the rig, and how the refit skeleton's are shown."""

import cage_rig_core as core
import numpy as np
import pytest

REST = np.stack([np.array([[0, 1, 0, x], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], float) for x in (-1, 0)])


def test_transforms_are_posed_times_the_inverse_of_rest_and_the_identity_at_rest():
    bones = core.Bones(REST)
    posed = REST.copy()
    posed[0, 0, 3] += 1e-8
    posed[1, :3, :3] = np.diag([1, 2, 3]) @ posed[1, :3, :3]
    for given in (posed, posed.astype(np.float32), np.asfortranarray(posed)):
        found = bones.transforms(given)
        assert np.array_equal(found[0], np.eye(4))
        np.testing.assert_allclose(found[1], posed[1] @ np.linalg.inv(REST[1]), atol=1e-7)
    np.testing.assert_array_equal(bones.heads, REST[:, :3, 3])


def test_refit_bones_stand_at_the_refit_joints_and_reach_their_children(bar, bent):
    rig = core.CoupledRig(**bar)
    rest = np.tile(np.eye(4), (2, 1, 1))
    rest[:, :3, 3] = bar["joints"]
    stretched = bar["cage_vertices"] * 1.5
    rig.play(stretched, bent)
    shown = rest @ rig.refit_pose(core.Bones(rest))
    np.testing.assert_allclose(shown[:, :3, 3], rig.posed_joints, atol=1e-9)
    np.testing.assert_allclose(shown[:, :3, :3], rig.transforms[:, :3, :3], atol=1e-9)
    length = np.linalg.norm(bar["joints"][1] - bar["joints"][0])
    along = rest.copy()
    turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], float)  # y along x, where the bar's bones go
    along[:, :3, :3] = turn
    shown = along @ rig.refit_pose(core.Bones(along, [[0, 1]], [length]))
    np.testing.assert_allclose(shown[0] @ [0, length, 0, 1], [*rig.posed_joints[1], 1], atol=1e-6)


def test_playing_posed_bones_is_playing_their_transforms(bar, bent):
    rig, other = core.CoupledRig(**bar), core.CoupledRig(**bar)
    rest = np.tile(np.eye(4), (2, 1, 1))
    rest[:, :3, 3] = bar["joints"]
    bones, posed = core.Bones(rest), np.array(bent) @ rest
    assert rig.play_posed(bar["cage_vertices"] * 1.2, bones, posed.astype(np.float32))
    assert not rig.play_posed(bar["cage_vertices"] * 1.2, bones, posed.astype(np.float32))
    assert other.play(bar["cage_vertices"] * 1.2, bones.transforms(posed.astype(np.float32)), bones.heads)
    np.testing.assert_array_equal(rig.posed_skin, other.posed_skin)
    assert np.abs(rig.posed_skin - core.CoupledRig(**bar).posed_skin).max() > 0.1


def test_play_says_whether_anything_was_new(bar, bent):
    rig = core.CoupledRig(**bar)
    assert rig.play(bar["cage_vertices"], bent)
    assert not rig.play(bar["cage_vertices"].copy(), bent.copy())
    assert rig.play(bar["cage_vertices"] * 1.1, bent)


def test_wrong_bones_are_refused_by_name(bar):
    with pytest.raises(ValueError, match=r"rest must be \(#J, 4, 4\)"):
        core.Bones(REST[0])
    with pytest.raises(ValueError, match="bone 2, but there are 2 bones"):
        core.Bones(REST, [[0, 2]], [1.0])
    with pytest.raises(ValueError, match=r"posed must be \(2, 4, 4\)"):
        core.Bones(REST).transforms(REST[:1])
    with pytest.raises(ValueError, match="not finite"):
        core.Bones(REST).transforms(REST * np.nan)
    with pytest.raises(ValueError, match="the rig has 2 joints, these are 1 bones"):
        core.CoupledRig(**bar).play_posed(bar["cage_vertices"], core.Bones(REST[:1]), REST[:1])
    with pytest.raises(ValueError, match="the rig has 2 joints, these are 1 bones"):
        core.CoupledRig(**bar).refit_pose(core.Bones(REST[:1]))
