"""Cages of real characters: the shared ones where they are there."""

import os
from pathlib import Path

import cage_rig_core as core
import numpy as np
import pytest
from characters import character

SHARED = Path(os.environ.get("CAGE_RIG_SHARED") or Path(__file__).resolve().parents[3] / "shared")
FOLDER = SHARED / "data" / "characters"


def load(name):
    path = FOLDER / f"{name}.glb"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    return character(path)


def winding(points, vertices, triangles):
    """How often a closed mesh winds around each point, by solid angles (Van Oosterom, Strackee 1983)."""
    a, b, c = (vertices[triangles[:, k]][None] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
    volume = np.einsum("pti,pti->pt", a, np.cross(b, c))
    dots = [np.einsum("pti,pti->pt", x, y) * z for x, y, z in ((a, b, lc), (b, c, la), (c, a, lb))]
    return np.arctan2(volume, la * lb * lc + sum(dots)).sum(axis=1) / (2 * np.pi)


def check(skin, vertices, triangles, report):
    """What every cage must be, looked at from outside."""
    assert len(vertices) == 4 * len(report["sections"])
    assert len(triangles) == 2 * len(vertices) - 4 + 4 * report["genus"]
    assert np.array_equal(np.bincount(report["vertex_sections"]), np.full(len(report["sections"]), 4))
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert counts.max() == 1, "closed, each side in two faces that agree"
    assert set(map(tuple, edges.tolist())) == set(map(tuple, edges[:, ::-1].tolist()))
    assert not core.check_cage(vertices, triangles)["turned"]
    for part in np.array_split(skin, len(skin) // 400 + 1):
        assert np.abs(winding(part, vertices, triangles) - 1).max() < 1e-6, "skin outside"
    assert report["clearance"] >= 1e-4
    assert report["min_angle"] >= 5
    sample = skin[:: len(skin) // 500 + 1]
    assert core.mean_value_coordinates(sample, vertices, triangles).min() >= -0.3


@pytest.mark.parametrize(
    ("name", "placement"), [("human_2k_53b", "automatic"), ("human_2k_53b", "joints"), ("proc_airplane", "automatic")]
)
def test_a_character_is_caged(name, placement):
    skin, faces, nodes, edges = load(name)
    options = {"placement": placement, "triangles": True}
    vertices, triangles, report = core.generate_cage(skin, faces, nodes, edges, options=options)
    check(skin, vertices, triangles, report)
    if name.startswith("human"):
        image = vertices[report["mirror"]] * [-1, 1, 1] + [skin[:, 0].min() + skin[:, 0].max(), 0, 0]
        assert np.abs(image - vertices).max() < 1e-6 * np.linalg.norm(np.ptp(skin, axis=0))


def test_sections_of_a_character_are_distinct_and_mirrored():
    skin, faces, nodes, edges = load("human_2k_53b")
    sections = core.cage_sections(skin, faces, nodes, edges)
    for section in sections:
        corners = section["corners"]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
        assert sides.min() > 0.1 * section["radius"], section["node"]
    middles = np.array([section["corners"].mean(axis=0) for section in sections])
    images = middles * [-1, 1, 1] + [skin[:, 0].min() + skin[:, 0].max(), 0, 0]
    nearest = np.linalg.norm(images[:, None] - middles[None], axis=2).min(axis=1)
    assert nearest.max() < 1e-6


def test_a_node_that_is_moved_still_gives_a_cage():
    skin, faces, nodes, edges = load("human_2k_53b")
    generator = core.CageGenerator(skin, faces, nodes, edges, options={"triangles": True})
    bending = [section for section in generator.sections() if section["kind"] == "bending"]
    points = np.array([section["point"] for section in bending])
    for at, way in ((0, 0.3), (len(bending) // 3, -0.3), (2 * len(bending) // 3, 0.3)):
        moved = points.copy()
        moved[at] += way * bending[at]["radius"] * bending[at]["direction"]
        vertices, triangles, report = generator.generate(moved).result()
        check(skin, vertices, triangles, report)


def test_tessellations_of_one_character_get_the_same_sections():
    """Limb by limb: one rig, and a hundred times as many triangles."""
    found = []
    for name in ("human_2k_53b", "human_200k_53b"):
        sections = core.cage_sections(*load(name))
        arcs = sorted({s["arc"] for s in sections})
        found.append([[s["kind"] for s in sections if s["arc"] == arc] for arc in arcs])
    assert found[0] == found[1]
    assert len(found[0]) == 16


@pytest.mark.parametrize(("name", "leaves"), [("human_24k_52b", 5), ("fox_576_24b", 6), ("proc_octopus_20k_66b", 9)])
def test_a_skeleton_found_in_a_skin_is_one_tree(name, leaves):
    skin, faces, _, _ = load(name)
    nodes, edges = core.extract_skeleton(skin, faces)
    reached = {0}
    for _ in nodes:
        reached |= {int(v) for edge in edges if reached & set(edge.tolist()) for v in edge}
    assert len(reached) == len(nodes) == len(edges) + 1
    assert np.count_nonzero(np.bincount(edges.ravel()) == 1) == leaves
    if name != "proc_octopus_20k_66b":  # which is not symmetric
        image = nodes * [-1, 1, 1] + [skin[:, 0].min() + skin[:, 0].max(), 0, 0]
        apart = np.linalg.norm(image[:, None] - nodes[None], axis=2)
        assert apart.min(axis=1).max() < 1e-6 * np.linalg.norm(np.ptp(skin, axis=0))


@pytest.mark.parametrize("placement", ["automatic", "joints"])
def test_a_cow_without_bones_gets_legs_ears_horns_and_tail(placement):
    path = FOLDER / "spot_unrigged.obj"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    lines = [line.split() for line in path.read_text().splitlines() if line]
    skin = np.array([line[1:4] for line in lines if line[0] == "v"], float)
    corners = [[int(corner.split("/")[0]) - 1 for corner in line[1:]] for line in lines if line[0] == "f"]
    faces = np.array([(face[0], *face[k : k + 2]) for face in corners for k in range(1, len(face) - 1)])
    skeleton = core.extract_skeleton(skin, faces)
    leaves = np.count_nonzero(np.bincount(skeleton[1].ravel()) == 1)
    assert leaves == 9
    _, _, report = core.generate_cage(skin, faces, *skeleton, options={"placement": placement})
    assert not len(report["dropped_nodes"])
    assert report["volume_ratio"] < 1.35
    assert sum(section["kind"] == "leaf" for section in report["sections"]) == leaves
