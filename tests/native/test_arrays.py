"""What the door accepts and refuses: every refusal names the argument, the expected and the found."""

import re

import cage_rig_core as core
import numpy as np
import pytest


def refused(kind, *parts):
    return pytest.raises(kind, match=".*".join(re.escape(part) for part in parts))


def layouts(array):
    yield np.asfortranarray(array)
    yield array.astype(np.float32)
    yield np.repeat(array, 2, axis=0)[::2]
    yield array[::-1].copy()[::-1]
    frozen = array.copy()
    frozen.flags.writeable = False
    yield frozen
    packed = np.zeros(len(array), dtype=[("gap", "u1"), ("xyz", "f8", 3)])
    packed["xyz"] = array
    yield packed["xyz"]  # not aligned
    yield array.tolist()


def test_any_layout_gives_the_same_rig(bar, bent):
    expected = core.CoupledRig(**bar)
    expected.pose(bent)
    for cage in layouts(bar["cage_vertices"]):
        rig = core.CoupledRig(**{**bar, "cage_vertices": cage})
        rig.pose(np.asfortranarray(bent))
        assert np.abs(rig.posed_skin - expected.posed_skin).max() < 1e-5


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "i4", "u4", "i8"])
def test_indices_of_any_width(bar, dtype):
    corners, sizes = bar["cage_faces"]
    parents = bar["parents"].astype(dtype if dtype[0] == "i" else "i8")
    core.CoupledRig(**{**bar, "cage_faces": (corners.astype(dtype), sizes.astype(dtype)), "parents": parents})


WRONG = [
    ("skin_vertices", np.zeros((5, 2)), "(#M, 3)", "(5, 2) of float64"),
    ("skin_vertices", np.zeros((5, 3), int), "float32 or float64", "(5, 3) of int64"),
    ("skin_vertices", np.zeros((5, 3), np.float16), "float32 or float64", "float16"),
    ("skin_vertices", np.zeros((5, 3), ">f8"), "float32 or float64", ">f8"),
    ("skin_vertices", "text", "(#M, 3)", "()"),
    ("skin_faces", np.zeros((5, 4), int), "(#F, 3)", "(5, 4) of int64"),
    ("skin_faces", np.zeros((5, 3)), "integers", "float64"),
    ("skin_weights", np.zeros((124, 3)), "(124, 2)", "(124, 3)"),
    ("skin_weights", np.zeros((5, 2)), "(124, 2)", "(5, 2)"),
    ("joints", np.zeros(3), "(#J, 3)", "(3)"),
    ("parents", np.zeros((2, 1), int), "(n)", "(2, 1)"),
    ("parents", np.zeros(2, ">i4"), "integers", ">i4"),
    ("cage_vertices", np.zeros((5, 4)), "(#C, 3)", "(5, 4)"),
    ("cage_faces", np.zeros((5, 3), bool), "integers", "bool"),
    ("cage_coords", np.zeros((3, 16)), "(124, 16)", "(3, 16)"),
    ("joint_coords", np.zeros((2, 15)), "(2, 16)", "(2, 15)"),
    ("center_coords", np.zeros((3, 16)), "(124, 16)", "(3, 16)"),
]


@pytest.mark.parametrize(("name", "value", "expected", "found"), WRONG)
def test_a_wrong_array_is_refused_by_name_shape_and_type(bar, name, value, expected, found):
    with refused(core.ArrayError, name, expected, "found", found):
        core.CoupledRig(**{**bar, name: value})


def test_a_number_that_is_not_finite_is_refused_by_row(bar):
    for name in ["skin_vertices", "joints", "cage_vertices"]:
        bad = bar[name].copy()
        bad[1, 2] = np.nan
        with refused(core.ArrayError, name, "row 1"):
            core.CoupledRig(**{**bar, name: bad})


def test_edits_check_their_arrays(bar, bent):
    rig = core.CoupledRig(**bar)
    with refused(core.ArrayError, "transforms", "(2, 4, 4)", "(2, 3, 4)"):
        rig.pose(bent[:, :3])
    with refused(core.ArrayError, "rest_joints", "(2, 3)", "(1, 3)"):
        rig.pose(bent, np.zeros((1, 3)))
    with refused(core.PoseError, "joint 1", "0 0 0 1"):
        bad = bent.copy()
        bad[1, 3, 0] = 0.5
        rig.pose(bad)
    for edit in (rig.edit_rest_cage, rig.edit_posed_cage, lambda cage: rig.play(cage, bent)):
        with refused(core.ArrayError, "cage", "(16, 3)", "(15, 3)"):
            edit(np.zeros((15, 3)))
    with refused(core.ArrayError, "offsets", "(124, 3)", "(3, 3)"):
        rig.offset_rest_skin(np.zeros((3, 3)))


def test_out_must_fit_and_be_writable(bar):
    rig = core.CoupledRig(**bar)
    frozen = np.zeros((124, 3))
    frozen.flags.writeable = False
    with refused(core.ArrayError, "out", "writable"):
        rig.posed_skin_into(frozen)
    for bad in [np.zeros((124, 3), int), np.zeros((124, 4)), np.zeros(125), np.zeros((124, 3), ">f4")]:
        with refused(core.ArrayError, "out", "float32 or float64", "found"):
            rig.posed_skin_into(bad)
    with refused(core.ArrayError, "out", "124 rows", "from row 1 "):
        rig.posed_skin_into(np.zeros((124, 3)), start=1)
    with refused(core.ArrayError, "out"):
        rig.posed_skin_into([[0.0, 0.0, 0.0]])


def test_faults_of_the_input_have_their_own_exceptions(bar):
    def bind(**changes):
        return core.CoupledRig(**{**bar, **changes})

    corners, sizes = bar["cage_faces"]
    with refused(core.CageError, "open"):
        bind(cage_faces=(corners[4:], sizes[1:]))
    with refused(core.CageError, "face 1", "flipped"):
        bind(cage_faces=(np.concatenate([corners[:4], corners[4:8][::-1], corners[8:]]), sizes))
    with refused(core.SkinError, "face 0", "vertex 999"):
        bind(skin_faces=np.array([[0, 1, 999]]))
    with refused(core.SkinError, "anchor 124"):
        bind(anchors=np.arange(109, 125))
    with refused(core.SkinError, "anchor 3", "twice"):
        bind(anchors=np.full(16, 3))
    with refused(core.ArrayError, "anchors", "16", "3"):
        bind(anchors=np.arange(3))
    with refused(core.WeightsError, "vertex 0", "joint 1", "negative"):
        bind(skin_weights=np.tile([1.0, -1.0], (124, 1)))
    with refused(core.WeightsError, "not a finite number"):
        bind(skin_weights=np.full((124, 2), np.nan))
    with refused(core.SkeletonError, "own ancestor"):
        bind(parents=np.array([1, 0]))
    with refused(core.SkeletonError, "parent 7"):
        bind(parents=np.array([-1, 7]))
    with refused(core.CageRigError, "no skinning method named", "lbs"):
        bind(method="ragdoll")
    with refused(core.CageRigError, "no kind of coordinates named", "mean_value"):
        bind(coordinates="green")
    with refused(core.CageRigError, "no option named", "min_singular"):
        bind(options={"speed": 1})
    with refused(core.CageRigError, "min_singular", "found 2"):
        bind(options={"min_singular": 2.0})
    with refused(core.CageRigError, "center_sigma", "found 0"):
        bind(options={"center_sigma": 0.0})
    with refused(core.ArrayError, "skin_faces", "pair", "tuple of 3"):
        bind(skin_faces=(corners, sizes, sizes))
    with refused(core.ArrayError, "skin_faces", "add up"):
        bind(skin_faces=(corners, sizes[1:]))
    with refused(core.ArrayError, "skin_weights", "triple", "tuple of 2"):
        bind(skin_weights=(corners, sizes))


def test_every_exception_is_a_value_error():
    kinds = [core.CageError, core.SkinError, core.WeightsError, core.SkeletonError, core.PoseError, core.ArrayError]
    assert all(issubclass(kind, core.CageRigError) for kind in kinds)
    assert issubclass(core.CageRigError, ValueError)
