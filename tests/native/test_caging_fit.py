"""Rough cages made to fit: the same faces around the skin, checked from outside."""

import cage_rig_core as core
import exact
import numpy as np
import pytest
from test_caging_characters import load
from test_caging_like import arrays, split


@pytest.fixture(scope="module")
def doll():
    return arrays()


@pytest.fixture(scope="module")
def rough(doll):
    """A generated cage whose vertices were pushed about, through the skin."""
    vertices, faces, report = core.generate_cage(*doll)
    inward = np.array([report["sections"][at]["point"] for at in report["vertex_sections"]])
    return inward + (vertices - inward) * np.random.default_rng(3).uniform(0.75, 1.1, (len(vertices), 1)), faces


def check(skin, faces, cage, polygons, report):
    """Both ways to split quads; nothing crosses, all is inside."""
    for turn in (0, 1) if isinstance(polygons, tuple) else (0,):
        triangles = split(polygons, turn) if isinstance(polygons, tuple) else polygons
        assert not len(exact.meeting(cage, triangles, skin, faces))
        assert not len(exact.self_meeting(cage, triangles))
        some = skin[:: len(skin) // 500 + 1]
        assert np.abs(exact.winding(some, cage, triangles) - 1).max() < 1e-6
    assert report["clearance"] >= 1e-4


def test_a_cage_through_the_skin_is_drawn_around_it(doll, rough):
    skin, faces = doll[:2]
    assert len(exact.meeting(rough[0], split(rough[1], 0), skin, faces))
    cage, polygons, report = core.fit_cage(*doll, *rough)
    check(skin, faces, cage, polygons, report)
    assert all(np.array_equal(mine, its) for mine, its in zip(polygons, rough[1], strict=True))
    assert report["min_angle"] >= 5
    assert len(report["vertex_sections"]) == len(cage)


def test_a_fitted_cage_is_no_looser_than_a_generated_one(doll, rough):
    generated = core.generate_cage(*doll)[2]
    fitted = core.fit_cage(*doll, *rough)[2]
    assert fitted["volume_ratio"] < 1.05 * generated["volume_ratio"]


def test_a_kept_generator_fits_in_a_thread(doll, rough):
    job = core.CageGenerator(*doll).fit(*rough)
    assert job.wait()
    assert np.array_equal(job.result()[0], core.fit_cage(*doll, *rough)[0])


def test_progress_is_told_and_can_cancel(doll, rough):
    told = []
    core.fit_cage(*doll, *rough, progress=lambda stage, part: told.append((stage, part)))
    stages = list(dict.fromkeys(stage for stage, _ in told))
    assert stages == [
        "cross sections",
        "a start inside the skin",
        "growing the cage",
        "tightening the cage",
        "checking the cage",
    ], "however short they are"
    assert [part for _, part in told] == sorted(part for _, part in told)
    with pytest.raises(core.CagingError) as refused:
        core.fit_cage(*doll, *rough, progress=lambda _stage, _part: False)
    assert refused.value.cancelled


def test_faults_of_the_rough_cage_are_named(doll, rough):
    vertices, (corners, sizes) = rough
    with pytest.raises(core.CagingError, match=r"the rough cage can't be fitted: .*edge"):
        core.fit_cage(*doll, vertices, (corners[sizes[0] :], sizes[1:]))
    with pytest.raises(core.CageRigError, match="not finite"):
        core.fit_cage(*doll, np.where(np.arange(len(vertices))[:, None] == 3, np.nan, vertices), (corners, sizes))
    with pytest.raises(core.CagingError, match="leaves out the middle of the skin") as refused:
        core.fit_cage(*doll, np.add(vertices, [5, 0, 0]), (corners, sizes))
    assert refused.value.place is not None and refused.value.node is not None
    folded = vertices.copy()
    folded[:4] = folded[8:12] + 0.4 * (folded[8:12].mean(axis=0) - folded[8:12])
    with pytest.raises(core.CagingError, match="crosses itself at vertex") as refused:
        core.fit_cage(*doll, folded, (corners, sizes))
    assert refused.value.place is not None


@pytest.mark.parametrize(
    ("name", "part"), [("proc_octopus_20k_66b", 0.95), ("proc_airplane", 0.95), ("fox_576_24b", 0.9)]
)
def test_characters_are_fitted_with_their_own_cages_drawn_in(name, part):
    """Smaller about the middle of each section, so that the skin sticks out."""
    given = load(name)
    vertices, faces, report = core.generate_cage(*given)
    inward = np.array([report["sections"][at]["point"] for at in report["vertex_sections"]])
    rough = inward + part * (vertices - inward)
    assert len(exact.meeting(rough, split(faces, 0), *given[:2]))
    cage, polygons, fitted = core.fit_cage(*given, rough, faces)
    check(*given[:2], cage, polygons, fitted)
    assert fitted["volume_ratio"] < 1.1 * report["volume_ratio"]


def test_a_cage_of_another_level_of_detail_is_fitted():
    vertices, faces, report = core.generate_cage(*load("human_2k_53b"))
    given = load("human_24k_52b")
    cage, polygons, fitted = core.fit_cage(*given, vertices, faces)
    check(*given[:2], cage, polygons, fitted)
    assert fitted["volume_ratio"] < 1.1 * report["volume_ratio"]


def broken(kind, vertices, corners, sizes, random):
    """A rough cage with something wrong."""
    one, other = random.choice(len(vertices), 2, replace=False)
    if kind == "noisy":
        return vertices + random.normal(0, 0.02, vertices.shape), corners, sizes
    if kind == "far too large":
        return vertices * 5, corners, sizes
    if kind == "flat":
        return vertices * [0, 1, 1], corners, sizes
    if kind == "two vertices in one place":
        return np.where(np.arange(len(vertices))[:, None] == one, vertices[other], vertices), corners, sizes
    if kind == "another corner":
        return vertices, np.where(np.arange(len(corners)) == 7, other, corners), sizes
    if kind == "inside out":
        return vertices, corners[::-1], sizes[::-1]
    if kind == "a spike":
        return np.where(np.arange(len(vertices))[:, None] == one, 1e6 * vertices, vertices), corners, sizes
    if kind == "empty":
        return vertices[:0], corners[:0], sizes[:0]
    if kind == "a vertex that is not there":
        return vertices, np.where(np.arange(len(corners)) == 7, 10**9, corners), sizes
    return vertices + random.normal(0, 0.3, 3), corners, sizes


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    "kind",
    [
        "noisy",
        "far too large",
        "flat",
        "two vertices in one place",
        "another corner",
        "inside out",
        "a spike",
        "empty",
        "a vertex that is not there",
        "elsewhere",
    ],
)
def test_broken_rough_cages_are_named_or_fitted(doll, rough, kind, seed):
    vertices, (corners, sizes) = rough
    vertices, corners, sizes = broken(kind, vertices, corners, sizes, np.random.default_rng(seed))
    try:
        cage, polygons, report = core.fit_cage(*doll, vertices, (corners, sizes))
    except core.CagingError as refused:
        assert "the rough cage" in str(refused)
        return
    check(*doll[:2], cage, polygons, report)
