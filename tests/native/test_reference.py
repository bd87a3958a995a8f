"""The Arm of [CTL*20] through the binding, as a script of a user would drive it."""

import cage_rig_core as core
import numpy as np
import pytest


@pytest.fixture
def inputs(arm):
    given = arm["inputs"]
    return {
        "skin_vertices": given["V"],
        "skin_faces": given["F"],
        "skin_weights": given["Omega"],
        "joints": given["joints"],
        "parents": given["parents"],
        "cage_vertices": given["C0"],
        "cage_faces": given["CF"],
    }


def test_coordinates_and_joints(arm, inputs):
    rig = core.CoupledRig(**inputs)
    assert np.abs(rig.cage_coords - arm["bind"]["Phi"]).max() <= 1e-9
    assert np.abs(rig.joint_coords @ inputs["cage_vertices"] - inputs["joints"]).max() <= 1e-10 * rig.size
    direct = core.mean_value_coordinates(inputs["skin_vertices"], inputs["cage_vertices"], inputs["cage_faces"])
    np.testing.assert_array_equal(direct, rig.cage_coords)


@pytest.mark.parametrize("method", core.skinning_methods())
def test_poses(arm, inputs, method):
    poses = arm["poses"]
    rig = core.CoupledRig(**inputs, anchors=arm["inputs"]["maxvol"], method=method, center_coords=arm["bind"]["Lambda"])
    for k in range(len(poses["t"])):
        rig.pose(poses["T_skin"][k])
        assert np.abs(rig.posed_skin - poses[f"Mp_{method}"][k]).max() <= 2e-6 * rig.size
        assert np.abs(rig.posed_cage - poses["Cp_lbs"][k]).max() <= 1e-8


def test_a_drag_of_the_posed_cage(arm, inputs):
    sample = arm["reverse_sample"]
    rig = core.CoupledRig(**inputs, anchors=arm["inputs"]["maxvol"], joint_coords=arm["bind"]["Psi"])
    for k in range(2):
        rig.play(inputs["cage_vertices"], sample["lbs_T_skin_after"][k, 0], sample["lbs_rest_joints_after"][k, 0])
        rig.edit_posed_cage(sample["lbs_Cp_before"][k, 0] + sample["dCp"][0])
        assert np.abs(rig.rest_cage - sample["lbs_C_after"][k, 0]).max() <= 1e-7
        assert np.abs(rig.joints - sample["lbs_rest_joints_after"][k, 0]).max() <= 1e-7
        assert np.abs(rig.transforms - sample["lbs_T_skin_after"][k, 0]).max() <= 1e-7
        assert np.abs(rig.posed_cage - sample["lbs_Cp_after"][k, 0]).max() <= 1e-7
