"""The rig through its Python names: the cycle, the copies, the twins that write in place."""

import threading

import cage_rig_core as core
import numpy as np
import pytest


def read(rig):
    """The arrays that are made when they are read."""
    return rig.posed_skin, rig.posed_cage


def test_the_six_structures_and_the_edits(bar, bent):
    rig = core.CoupledRig(**bar)
    assert rig.rest_skin.shape == rig.posed_skin.shape == bar["skin_vertices"].shape
    np.testing.assert_array_equal(rig.rest_cage, bar["cage_vertices"])
    np.testing.assert_allclose(rig.joints, bar["joints"], atol=1e-12)
    rig.pose(bent)
    np.testing.assert_allclose(rig.transforms, bent, atol=1e-12)
    np.testing.assert_allclose(rig.posed_joints, bar["joints"], atol=1e-12)
    wanted = rig.posed_cage + 0.1 * np.sin(np.arange(48)).reshape(16, 3)
    rig.edit_posed_cage(wanted)
    fresh = core.CoupledRig(**bar)
    fresh.play(rig.rest_cage, bent)
    assert np.abs(fresh.posed_cage - wanted).max() <= 1e-9 * rig.size
    rig.edit_rest_cage(bar["cage_vertices"])
    rig.pose(np.tile(np.eye(4), (2, 1, 1)))
    np.testing.assert_allclose(rig.posed_skin, bar["skin_vertices"], atol=1e-6)


def test_results_are_fresh_float64_copies(bar):
    rig = core.CoupledRig(**bar)
    for name in [
        "rest_skin",
        "posed_skin",
        "rest_cage",
        "posed_cage",
        "joints",
        "posed_joints",
        "transforms",
        "cage_coords",
        "joint_coords",
    ]:
        first = getattr(rig, name)
        assert first.dtype == np.float64, name
        first[...] = 7
        assert not np.array_equal(getattr(rig, name), first), name


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_into_writes_a_range_of_rows_in_any_layout(bar, bent, dtype):
    rig = core.CoupledRig(**bar)
    rig.pose(bent)
    expected = rig.posed_skin.astype(dtype)
    for out in [
        np.zeros((50, 3), dtype),
        np.zeros((50, 3), dtype, order="F"),
        np.zeros((100, 6), dtype)[::2, ::2],
        np.zeros(150, dtype),
    ]:
        rig.posed_skin_into(out, start=20)
        np.testing.assert_array_equal(out.reshape(50, 3), expected[20:70])
    cage = np.zeros((16, 3), dtype)
    rig.posed_cage_into(cage)
    np.testing.assert_array_equal(cage, rig.posed_cage.astype(dtype))
    rest = np.zeros((124, 3), dtype)
    rig.rest_skin_into(rest)
    np.testing.assert_array_equal(rest, rig.rest_skin.astype(dtype))


def test_offsets_move_the_visible_skin_only(bar, bent):
    rig = core.CoupledRig(**bar)
    rig.pose(bent)
    cage, skin = rig.posed_cage, rig.posed_skin
    rig.offset_rest_skin(np.full_like(bar["skin_vertices"], 0.25))
    np.testing.assert_array_equal(rig.posed_cage, cage)
    assert np.abs(rig.posed_skin - skin).max() > 0.2
    rig.offset_rest_skin(None)
    np.testing.assert_array_equal(rig.posed_skin, skin)


@pytest.mark.parametrize("method", core.skinning_methods())
def test_the_method_can_be_changed_at_any_time(bar, bent, method):
    bound, changed = core.CoupledRig(**bar, method=method), core.CoupledRig(**bar)
    assert (bound.method, changed.method) == (method, "lbs")
    for rig in (bound, changed):
        rig.pose(bent)
        read(rig)
    cage, work = changed.posed_cage, changed.work
    changed.set_method(method)
    assert changed.method == method
    np.testing.assert_array_equal(changed.posed_skin, bound.posed_skin)
    np.testing.assert_array_equal(changed.posed_cage, cage)
    assert changed.work["skin_passes"] == work["skin_passes"] + (method != "lbs")
    assert changed.work["cage_fits"] == work["cage_fits"]
    again = changed.work
    changed.set_method(method)
    read(changed)
    assert changed.work == again


def test_an_unknown_method_is_refused_with_the_choices(bar):
    rig = core.CoupledRig(**bar)
    with pytest.raises(core.CageRigError, match=r"ragdoll.*lbs, dqs, cor"):
        rig.set_method("ragdoll")
    assert rig.method == "lbs"


def test_centers_are_known_once_a_method_has_needed_them(bar, bent):
    rig = core.CoupledRig(**bar)
    assert rig.center_coords is None
    rig.set_method("cor")
    coords = rig.center_coords
    assert coords.shape == (124, 16)
    np.testing.assert_allclose(coords.sum(1), 1, atol=1e-12)
    # Vertices that blend turn about the axis of the bar.
    centers = coords @ bar["cage_vertices"]
    blended = np.abs(bar["skin_vertices"][:, 0] - 5) < 1
    assert np.abs(centers[blended, 1:]).max() < 0.1
    rig.set_method("dqs")
    rig.set_method("cor")
    rig.pose(bent)
    read(rig)
    assert (rig.work["center_integrations"], rig.work["center_passes"]) == (1, 1)
    given = core.CoupledRig(**bar, method="cor", center_coords=coords)
    given.pose(bent)
    np.testing.assert_array_equal(given.posed_skin, rig.posed_skin)
    assert given.work["center_integrations"] == 0


def test_binned_centers_are_near_the_exact_ones(bar):
    exact, binned, broad = (
        core.CoupledRig(**bar, method="cor", options=options).center_coords @ bar["cage_vertices"]
        for options in ({"center_bins": 0}, {}, {"center_sigma": 1.0})
    )
    size = np.linalg.norm(np.ptp(bar["skin_vertices"], axis=0))
    assert 0 < np.abs(binned - exact).max() < 1e-3 * size
    assert np.abs(broad - exact).max() > 1e-3 * size


@pytest.mark.parametrize("method", core.skinning_methods())
def test_the_posed_cage_lands_where_it_is_dragged_on_a_bent_elbow(bar, method):
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    elbow = np.tile(np.eye(4), (2, 1, 1))
    elbow[1, :3, :3] = turn
    elbow[1, :3, 3] = bar["joints"][1] - turn @ bar["joints"][1]
    rig = core.CoupledRig(**bar, method=method)
    rig.pose(elbow)
    wanted = rig.posed_cage
    wanted[4:8] += [0.3, -0.2, 0.1]
    rig.edit_posed_cage(wanted)
    fresh = core.CoupledRig(**bar, method=method)
    fresh.play(rig.rest_cage, elbow)
    assert np.abs(fresh.posed_cage - wanted).max() <= 1e-9 * rig.size


def test_work_and_report_are_plain_dictionaries(bar, bent):
    rig = core.CoupledRig(**bar)
    rig.pose(bent)
    read(rig)
    before = rig.work
    assert before == {
        "anchor_factorisations": 1,
        "reverse_factorisations": 0,
        "reverse_low_rank": 0,
        "reverse_solves": 0,
        "rest_passes": 0,
        "rest_column_passes": 0,
        "rest_shape_passes": 0,
        "skin_passes": 1,
        "cage_fits": 1,
        "center_integrations": 0,
        "center_passes": 0,
        "center_column_passes": 0,
        "center_shape_passes": 0,
    }
    rig.pose(bent)
    read(rig)
    assert rig.work == before
    assert rig.report["regularised"] == 0 and rig.report["anchor_max_ratio"] <= 1.05
    assert rig.report["joints_outside_hull"] == [] and not rig.report["cage_turned"]


def test_known_results_are_taken_as_they_are(bar):
    first = core.CoupledRig(**bar)
    again = core.CoupledRig(
        **bar,
        anchors=first.anchors,
        cage_coords=first.cage_coords,
        joint_coords=first.joint_coords,
        center_coords=first.cage_coords,
    )
    np.testing.assert_array_equal(first.anchors, again.anchors)
    np.testing.assert_array_equal(first.joint_coords, again.joint_coords)
    assert first.center_coords is None
    np.testing.assert_array_equal(again.center_coords, first.cage_coords)


def test_compressed_weights_equal_dense_ones(bar):
    dense = bar["skin_weights"]
    indptr = np.arange(0, dense.size + 1, 2, dtype=np.int32)
    triple = (indptr, np.tile(np.array([0, 1], np.uint8), len(dense)), dense.ravel())
    pose = np.tile(np.eye(4), (2, 1, 1))
    pose[1, :3, 3] = 1
    rigs = [core.CoupledRig(**{**bar, "skin_weights": weights}) for weights in (dense, triple)]
    for rig in rigs:
        rig.pose(pose)
    np.testing.assert_array_equal(rigs[0].posed_skin, rigs[1].posed_skin)


def test_the_gil_is_released_during_a_bind(bar, square_tube):
    rings = [(i / 400, 0.6) for i in range(4001)]
    skin, faces = square_tube(rings)
    weights = np.ones((len(skin), 2))
    big = {**bar, "skin_vertices": skin, "skin_faces": faces, "skin_weights": weights}
    ticks = []
    thread = threading.Thread(target=core.CoupledRig, kwargs=big)
    thread.start()
    while thread.is_alive():
        ticks.append(1)
    assert len(ticks) > 100


def test_a_panic_is_an_exception_and_poisons_the_rig_alone(bar):
    rig = core.CoupledRig(**bar)
    with pytest.raises(core.PanicException, match="asked to by a test"):
        rig._panic_for_tests()
    assert not issubclass(core.PanicException, Exception)
    with pytest.raises(core.CageRigError, match="bind again"):
        rig.pose(np.tile(np.eye(4), (2, 1, 1)))
    with pytest.raises(core.CageRigError, match="bind again"):
        read(rig)
    assert core.CoupledRig(**bar).size > 0


def test_families_list_their_members():
    assert core.skinning_methods() == ["lbs", "dqs", "cor"]
    assert "mean_value" in core.coordinate_kinds()
    assert core.__version__


def test_a_cage_can_be_checked_alone(bar):
    found = core.check_cage(bar["cage_vertices"], bar["cage_faces"])
    assert found["turned"] is False and found["triangles"].shape == (28, 3)
    triangles = found["triangles"][:, ::-1]
    assert core.check_cage(bar["cage_vertices"], triangles)["turned"] is True


def test_a_mask_confines_the_cage_and_none_frees_it(bar):
    rig = core.CoupledRig(**bar)
    assert rig.report["vertices_outside"] == 0
    fat = bar["cage_vertices"] * [1, 1.5, 1.5]
    rig.edit_rest_cage(fat)
    whole = rig.rest_skin
    mask = np.clip(bar["skin_vertices"][:, 0] / 10, 0, 1)
    rig.mask_skin(mask.astype(np.float32))
    wanted = bar["skin_vertices"] + (whole - bar["skin_vertices"]) * mask[:, None]
    np.testing.assert_allclose(rig.rest_skin, wanted, atol=1e-6)
    with pytest.raises(core.SkinError, match="entry 3 of the mask"):
        rig.mask_skin(np.where(np.arange(len(mask)) == 3, 1.5, mask))
    with pytest.raises(core.ArrayError, match="mask"):
        rig.mask_skin(mask[1:])
    np.testing.assert_allclose(rig.rest_skin, wanted, atol=1e-6)
    rig.mask_skin(None)
    np.testing.assert_array_equal(rig.rest_skin, whole)


def test_a_rig_is_carried_by_what_is_below(bar):
    rig = core.CoupledRig(**bar)
    up = np.array([0, 0, 2.0])
    rig.carry(np.tile(up, (16, 1)), np.tile(up, (2, 1)))
    np.testing.assert_allclose(rig.joints, bar["joints"] + up, atol=1e-12)
    np.testing.assert_allclose(rig.posed_cage, bar["cage_vertices"] + up, atol=1e-12)
    np.testing.assert_array_equal(rig.rest_cage, bar["cage_vertices"])
    with pytest.raises(core.CageRigError, match="together"):
        rig.carry(None, np.tile(up, (2, 1)))
    rig.carry(None, None)
    np.testing.assert_allclose(rig.posed_cage, bar["cage_vertices"], atol=1e-12)


def test_a_cage_of_a_part_says_what_it_leaves_out(bar, square_tube):
    cage, faces = square_tube([(6.0, 0.9), (8.0, 1.1), (10.5, 0.9)])
    rig = core.CoupledRig(**{**bar, "cage_vertices": cage, "cage_faces": faces})
    outside = (bar["skin_vertices"][:, 0] < 6.0).sum()
    assert rig.report["vertices_outside"] == outside
    near = core.CoupledRig(**{**bar, "cage_vertices": cage, "cage_faces": faces}, options={"falloff": 0.1})
    assert rig.report["vertices_out_of_reach"] < near.report["vertices_out_of_reach"] <= outside
    with pytest.raises(core.SkinError, match="encloses no vertex"):
        core.CoupledRig(**{**bar, "cage_vertices": cage + np.array([0, 99, 0]), "cage_faces": faces})
    with pytest.raises(core.CageRigError, match="falloff"):
        core.CoupledRig(**bar, options={"falloff": 0.0})
