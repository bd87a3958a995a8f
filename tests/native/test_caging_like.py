"""A cage like another one: the same faces, index for index, around another level of detail of a character."""

import cage_rig_core as core
import exact
import numpy as np
import pytest
from test_caging_characters import load

from blend_fixtures.doll import doll

HUMANS = ("human_2k_53b", "human_24k_52b", "human_200k_53b", "human_24k_163b")


def arrays(**how):
    """Skin, triangles, and the bones as a graph."""
    character = doll(**how)
    skin, ends = character.skins[0], np.array([(bone.head, bone.tail) for bone in character.bones])
    nodes, edges = np.unique(ends.reshape(-1, 3), axis=0, return_inverse=True)
    triangles = np.concatenate([skin.faces[:, [0, 1, 2]], skin.faces[:, [0, 2, 3]]])
    return skin.vertices, triangles, nodes, edges.reshape(-1, 2)


@pytest.fixture(scope="module")
def coarse():
    return arrays()


@pytest.fixture(scope="module")
def fine():
    return arrays(cell=0.035, legs_first=True)


@pytest.fixture(scope="module")
def template(coarse):
    vertices, faces, _ = core.generate_cage(*coarse)
    return vertices, faces, 4


@pytest.fixture(scope="module")
def generator(fine):
    return core.CageGenerator(*fine)


@pytest.fixture(scope="module")
def alike(generator, template):
    return generator.generate(like=template).result()


def same(faces, other):
    return all(np.array_equal(mine, its) for mine, its in zip(faces, other, strict=True))


def split(faces, turn):
    """Triangles of quads and triangles; `turn`: from which corner quads are fans."""
    corners, sizes = faces
    starts = np.cumsum(sizes) - sizes
    rings = [corners[start : start + size] for start, size in zip(starts, sizes, strict=True)]
    rings = [np.roll(ring, -turn) if len(ring) == 4 else ring for ring in rings]
    return np.array([(ring[0], ring[k], ring[k + 1]) for ring in rings for k in range(1, len(ring) - 1)])


def check(skin, faces, cage, polygons, report):
    """Looked at from outside, quads split both ways."""
    middle = skin[:, 0].min() + skin[:, 0].max()
    size = np.linalg.norm(np.ptp(skin, axis=0))
    for turn in (0, 1):
        triangles = split(polygons, turn)
        assert not len(exact.meeting(cage, triangles, skin, faces))
        assert not len(exact.self_meeting(cage, triangles))
        assert np.abs(exact.winding(skin[:: len(skin) // 500 + 1], cage, triangles) - 1).max() < 1e-6
        assert core.mean_value_coordinates(skin[:: len(skin) // 500 + 1], cage, triangles).min() >= -0.3
    assert report["clearance"] >= 1e-4
    assert report["min_angle"] >= 5
    image = cage[report["mirror"]] * [-1, 1, 1] + [middle, 0, 0]
    assert np.abs(image - cage).max() < 1e-6 * size


@pytest.mark.parametrize("placement", ["automatic", "joints"])
def test_another_level_of_detail_gets_the_same_faces(coarse, fine, placement):
    options = {"placement": placement}
    vertices, faces, _ = core.generate_cage(*coarse, options=options)
    own, own_faces, own_report = core.generate_cage(*fine, options=options)
    assert len(own) != len(vertices) or not same(own_faces, faces), "or there was nothing to do"
    cage, found, report = core.generate_cage(*fine, options=options, like=(vertices, faces, 4))
    assert same(found, faces)
    check(*fine[:2], cage, found, report)
    assert sorted(np.abs(report["arrangement"])) == [1, 2, 3, 4, 5, 6]
    assert report["volume_ratio"] < 1.05 * own_report["volume_ratio"]
    size = np.linalg.norm(np.ptp(fine[0], axis=0))
    assert np.linalg.norm(cage - vertices, axis=1).max() < 0.1 * size, "each vertex is at the same limb"


def test_and_back(coarse, alike):
    cage, faces, report = core.generate_cage(*coarse, like=(*alike[:2], 4))
    assert same(faces, alike[1])
    check(*coarse[:2], cage, faces, report)


@pytest.mark.parametrize(("scale", "shift"), [(1.0, (3.0, 0.0, 1.0)), (40.0, (0.0, 0.0, 0.0)), (0.01, (0.2, 0.0, 0.0))])
def test_the_other_cage_may_be_elsewhere_and_of_another_size(fine, generator, template, scale, shift):
    vertices, faces, corners = template
    cage, found, report = generator.generate(like=(vertices * scale + shift, faces, corners)).result()
    assert same(found, faces)
    check(*fine[:2], cage, found, report)


def test_a_limb_that_the_other_lacks_gets_no_branch(template):
    """A tail, and a spine that it cuts in two."""
    skin, faces, nodes, edges = arrays(cell=0.05, tail=True)
    root, middle, top = (
        int(np.abs(nodes - [0, y, z]).sum(axis=1).argmin()) for y, z in ((0, 0.14), (0.02, 0.45), (0, 0.72))
    )
    edges = [edge for edge in edges.tolist() if set(edge) != {root, top}] + [[root, middle], [middle, top]]
    generator = core.CageGenerator(skin, faces, nodes, np.array(edges))
    assert len(generator.arcs) == 8
    cage, found, report = generator.generate(like=template).result()
    assert same(found, template[1])
    check(skin, faces, cage, found, report)
    assert len(report["dropped_nodes"]) == 1


def test_sections_are_those_of_the_other_cage(generator, template, alike):
    sections = generator.sections(like=template)
    middles = template[0].reshape(-1, 4, 3).mean(axis=1)
    assert [s["kind"] for s in sections] == [s["kind"] for s in alike[2]["sections"]]
    for section, middle in zip(sections, middles, strict=True):
        assert np.linalg.norm(section["point"] - middle) < 1.2 * section["radius"] + 0.06
    paths = [arc["path"] for arc in generator.arcs]
    for section in sections:
        assert np.linalg.norm(paths[section["arc"]] - section["place"], axis=1).min() < 0.1, (
            "arcs as the generator has them"
        )


def test_a_node_that_is_moved_leaves_faces_and_far_vertices(fine, generator, template, alike):
    vertices, faces, report = alike
    bending = np.array([s["place"] for s in report["sections"] if s["kind"] == "bending"])
    moved = bending.copy()
    low = np.argsort(bending[:, 2])[:2]  # of both legs
    moved[low] += [0.0, 0.0, 0.04]
    how = {"like": template, "arrangement": report["arrangement"]}
    cage, found, after = generator.generate(moved, (bending, vertices, faces), **how).result()
    assert same(found, faces)
    check(*fine[:2], cage, found, after)
    assert after["kept_vertices"] > 0.3 * len(vertices)
    assert "growth" not in after["timings"]
    assert list(after["arrangement"]) == list(report["arrangement"])


def test_nodes_of_another_number_are_refused(generator, template, alike):
    bending = np.array([s["place"] for s in alike[2]["sections"] if s["kind"] == "bending"])
    with pytest.raises(core.CagingError, match="cross sections from number") as error:
        generator.generate(bending[1:], like=template).result()
    assert error.value.section is not None


def test_another_kind_of_skeleton_is_refused(square_tube, generator, template):
    skin, faces = square_tube([(i / 3, 0.6) for i in range(31)])
    bones = np.array([[0.5, 0, 0], [5.0, 0, 0], [9.5, 0, 0]]), np.array([[0, 1], [1, 2]])
    cage, polygons, _ = core.generate_cage(skin, faces, *bones)
    with pytest.raises(core.CagingError, match="nothing here is like") as error:
        generator.generate(like=(cage, polygons, 4)).result()
    assert error.value.section == 0
    with pytest.raises(core.CagingError, match="nothing here is like"):
        core.generate_cage(skin, faces, *bones, like=template)


def test_what_is_no_generated_cage_is_refused(generator, template):
    vertices, faces, _ = template
    with pytest.raises(core.CagingError, match="has 11 corners in a cross section, not 4"):
        generator.generate(like=(vertices, faces, 11)).result()
    order = np.random.default_rng(0).permutation(len(vertices))
    for wrong in (
        (vertices[:-1], faces),
        (vertices, (order[faces[0]], faces[1])),
        (vertices, (faces[0][4:], faces[1][1:])),
    ):
        with pytest.raises(core.CagingError, match="no cross sections"):
            generator.generate(like=(*wrong, 4)).result()


def test_it_can_be_cancelled(generator, template):
    job = generator.generate(like=template)
    job.cancel()
    with pytest.raises(core.Cancelled):
        job.result()


@pytest.mark.parametrize(("one", "other"), [(0, 1), (1, 0), (1, 3)])
def test_humans_have_the_same_faces(one, other):
    """Also where a rig has two branchings in each palm instead of one."""
    vertices, faces, before = core.generate_cage(*load(HUMANS[one]))
    skin = load(HUMANS[other])
    cage, found, report = core.generate_cage(*skin, like=(vertices, faces, 4))
    assert same(found, faces)
    check(*skin[:2], cage, found, report)
    assert report["volume_ratio"] < max(1.02 * before["volume_ratio"], 1.55)
    assert report["mean_distance"] < 0.0143
