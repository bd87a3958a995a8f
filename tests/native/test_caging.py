"""Cages generated from skins and skeletons, through the Python module."""

import cage_rig_core as core
import numpy as np
import pytest


@pytest.fixture(scope="module")
def tube(square_tube):
    """A closed bar of 30 rings and a straight skeleton in it."""
    skin, faces = square_tube([(i / 3, 0.6 + 0.1 * np.sin(abs(i - 15))) for i in range(31)])
    nodes = np.array([[0.5, 0, 0], [5.0, 0, 0], [9.5, 0, 0]])
    return skin, faces, nodes, np.array([[0, 1], [1, 2]])


@pytest.fixture(scope="module")
def made(tube):
    """The bar's cage as it comes without options, and what was told of its progress."""
    stages = []
    cage = core.generate_cage(*tube, progress=lambda stage, part: stages.append((stage, part)))
    return *cage, stages


@pytest.mark.parametrize("placement", ["automatic", "joints"])
def test_a_bar_is_caged(tube, placement):
    vertices, faces, report = core.generate_cage(*tube, options={"placement": placement, "triangles": True})
    assert len(vertices) == 4 * len(report["sections"])
    assert len(faces) == 2 * len(vertices) - 4
    assert report["genus"] == 0
    assert report["clearance"] >= 1e-4
    assert report["mirror"] is not None
    assert not core.check_cage(vertices, faces)["turned"]
    coords = core.mean_value_coordinates(tube[0], vertices, faces)
    assert coords.min() > -0.3
    image = vertices[report["mirror"]] * [-1, 1, 1] + [tube[0][:, 0].min() + tube[0][:, 0].max(), 0, 0]
    assert np.abs(image - vertices).max() < 1e-6


def test_given_bending_nodes_are_kept_and_quads_stay_quads(tube):
    bending = np.array([[3.0, 0.1, 0], [5.0, 0, 0], [7.0, 0, -0.1]])
    vertices, (corners, sizes), report = core.generate_cage(*tube, bending_nodes=bending)
    assert [section["kind"] for section in report["sections"]] == ["leaf", "bending", "bending", "bending", "leaf"]
    assert len(vertices) == 20
    assert np.count_nonzero(sizes == 4) >= 4
    assert sizes.sum() == len(corners)


def test_tightening_leaves_sections_at_their_nodes(square_tube):
    """Also on a limb with a waist, where sections that slide out of it make the volume less."""
    skin, faces = square_tube([(i / 3, 0.3 + 0.3 * np.sin(i / 5) ** 2) for i in range(31)])
    nodes, bending = np.array([[0.5, 0, 0], [9.5, 0, 0]]), np.array([[3.5, 0, 0], [6.5, 0, 0]])
    vertices, _, report = core.generate_cage(skin, faces, nodes, np.array([[0, 1]]), bending_nodes=bending)
    for at, section in enumerate(report["sections"]):
        if section["kind"] == "bending":
            middle = vertices[report["vertex_sections"] == at].mean(axis=0)
            assert abs((middle - section["point"]) @ section["direction"]) < section["radius"]


def test_sections_come_without_a_cage(tube):
    sections = core.cage_sections(*tube, bending_nodes=[[5.0, 0, 0]])
    middle = sections[1]
    assert middle["kind"] == "bending"
    assert middle["corners"].shape == (4, 3)
    assert np.ptp(middle["corners"][:, 0]) < 0.3


def test_progress_is_told_and_can_cancel(tube, made):
    stages = made[-1]
    assert "growing the cage" in dict(stages)
    assert stages[-1][0] == "checking the cage"
    assert all(0 <= part <= 1 for _, part in stages)
    with pytest.raises(core.CagingError) as refused:
        core.generate_cage(*tube, progress=lambda stage, part: False)
    assert refused.value.cancelled

    def fails(stage, part):
        raise KeyError(stage)

    with pytest.raises(KeyError):
        core.generate_cage(*tube, progress=fails)


def test_a_job_generates_the_same_cage_in_a_thread_of_its_own(tube, made):
    vertices, faces, report, _ = made
    job = core.CagingJob(*tube)
    found = job.result()
    assert job.done
    assert job.progress == 1
    assert job.stage == "checking the cage"
    assert np.array_equal(found[0], vertices)
    assert np.array_equal(found[1][0], faces[0])
    assert found[2]["volume_ratio"] == report["volume_ratio"]


def test_a_cancelled_job_has_no_cage(tube):
    job = core.CagingJob(*tube)
    job.cancel()
    with pytest.raises(core.Cancelled):
        job.result()


def test_a_kept_generator_answers_as_a_new_one(tube):
    kept = core.CageGenerator(*tube)
    for middle in (5.0, 5.5, 5.0):
        bending = [[3.0, 0, 0], [middle, 0, 0]]
        for found, fresh in zip(kept.sections(bending), core.cage_sections(*tube, bending_nodes=bending), strict=True):
            assert np.array_equal(found["corners"], fresh["corners"])
    vertices, _, _ = kept.generate([[3.0, 0, 0], [5.0, 0, 0]]).result()
    fresh, _, _ = core.generate_cage(*tube, bending_nodes=[[3.0, 0, 0], [5.0, 0, 0]])
    assert np.array_equal(vertices, fresh)


def test_a_skin_without_an_armature_gets_a_skeleton(tube):
    skin, faces, _, _ = tube
    nodes, edges = core.extract_skeleton(skin, faces)
    inner = (nodes[:, 0] > 1) & (nodes[:, 0] < 9)  # its ends may lead into corners
    assert np.count_nonzero(inner) >= 2
    assert np.abs(nodes[inner, 1:]).max() < 0.2
    vertices, _, report = core.generate_cage(skin, faces, nodes, edges)
    assert len(vertices) == 4 * len(report["sections"])
    assert report["genus"] == 0


def test_faults_name_their_place(tube):
    skin, (corners, sizes), nodes, edges = tube
    with pytest.raises(core.CagingError, match="open at edge") as refused:
        core.generate_cage(skin, (corners[4:], sizes[1:]), nodes, edges)
    assert refused.value.place is not None
    with pytest.raises(core.CagingError, match="inside the skin"):
        core.generate_cage(skin, (corners, sizes), np.add(nodes, [0, 50, 0]), edges)
    with pytest.raises(core.CagingError, match="no nodes"):
        core.generate_cage(skin, (corners, sizes), np.zeros((0, 3)), np.zeros((0, 2), int))
    with pytest.raises(core.CageRigError, match="no option named"):
        core.generate_cage(skin, (corners, sizes), nodes, edges, options={"nope": 1})
    with pytest.raises(core.CagingError, match="option corners is 2; it must be between 3 and 8"):
        core.generate_cage(skin, (corners, sizes), nodes, edges, options={"corners": 2})


def test_an_inside_out_skin_is_turned(tube):
    skin, (corners, sizes), nodes, edges = tube
    turned = corners.reshape(-1, 4)[:, ::-1].ravel()
    assert core.CageGenerator(skin, (turned, sizes), nodes, edges).repairs["inside_out"]


def test_a_generator_tells_the_skeleton_that_it_uses(tube):
    skin, faces, nodes, edges = tube
    nodes = np.concatenate([nodes, [[5.0, 30.0, 0]]])  # a bone that leads outside
    edges = np.concatenate([edges, [[1, 3]]])
    generator = core.CageGenerator(skin, faces, nodes, edges)
    named = np.concatenate([arc["nodes"] for arc in generator.arcs])
    assert {0, 1, 2} <= set(named.tolist())
    assert 3 not in named
    for arc in generator.arcs:
        assert len(arc["path"]) == len(arc["nodes"])
        assert np.ptp(arc["path"][:, 1:]) < 0.1
    assert generator.repairs["parts"] == 1
