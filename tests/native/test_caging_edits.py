"""A cage whose bending nodes are edited: what the edit leaves alone stays, and all of it is a good cage."""

import cage_rig_core as core
import exact
import numpy as np
import pytest
from test_caging_characters import check, load

TRIANGLES = {"triangles": True}
PLACES = (2.0, 3.5, 5.0, 6.5, 8.0)


@pytest.fixture(scope="module")
def bar(square_tube):
    """A closed bar, thick and thin by turns, and a straight skeleton in it."""
    skin, faces = square_tube([(i / 3, 0.6 + 0.1 * np.sin(abs(i - 15))) for i in range(31)])
    return skin, faces, np.array([[0.5, 0, 0], [5.0, 0, 0], [9.5, 0, 0]]), np.array([[0, 1], [1, 2]])


@pytest.fixture(scope="module")
def kept(bar):
    """Its generator, and a cage with five nodes."""
    generator = core.CageGenerator(*bar, options=TRIANGLES | {"asymmetric": True})
    vertices, faces, _ = generator.generate(nodes(*PLACES)).result()
    return generator, vertices, faces


def nodes(*places):
    return np.array([[x, 0.0, 0.0] for x in places])


def edited(kept, *places, vertices=None):
    generator, before, faces = kept
    vertices = before if vertices is None else vertices
    return generator.generate(nodes(*places), (nodes(*PLACES), vertices, faces)).result()


def is_valid(skin, faces, vertices, triangles):
    corners, sizes = faces
    ends = np.cumsum(sizes)
    fans = [
        (corners[end - size], corners[end - k - 1], corners[end - k])
        for end, size in zip(ends, sizes, strict=True)
        for k in range(1, size - 1)
    ]
    assert not len(exact.meeting(vertices, triangles, skin, np.array(fans)))
    assert not len(exact.self_meeting(vertices, triangles))
    assert np.abs(exact.winding(skin, vertices, triangles) - 1).max() < 1e-6


def ring(vertices, report, section):
    return vertices[report["vertex_sections"] == section]


def test_a_moved_node_moves_its_section_and_leaves_the_far_ones(bar, kept):
    vertices, triangles, report = edited(kept, 2.0, 3.5, 5.4, 6.5, 8.0)
    assert report["kept_vertices"] == 16, "both ends, and the sections beyond the neighbours"
    far = np.isin(report["vertex_sections"], [0, 1, 5, 6])
    assert np.array_equal(vertices[far], kept[1][far])
    fresh, _, _ = kept[0].generate(nodes(2.0, 3.5, 5.4, 6.5, 8.0)).result()
    where = [cage[12:16, 0].mean() for cage in (kept[1], vertices, fresh)]
    assert not np.array_equal(vertices[12:16], kept[1][12:16])
    assert abs(where[1] - where[2]) < 0.15, "about where a new cage has it"
    assert report["min_angle"] >= 5
    assert "growth" not in report["timings"]
    is_valid(*bar[:2], vertices, triangles)


def test_a_new_node_gets_a_section_and_the_rest_stays(bar, kept):
    vertices, triangles, report = edited(kept, 2.0, 3.5, 4.3, 5.0, 6.5, 8.0)
    assert len(vertices) == len(kept[1]) + 4
    assert report["kept_vertices"] == 20
    old, new = [0, 1, 5, 6], [0, 1, 6, 7]
    for one, other in zip(old, new, strict=True):
        assert np.array_equal(ring(vertices, report, other), kept[1][4 * one : 4 * one + 4])
    is_valid(*bar[:2], vertices, triangles)


def test_a_removed_node_takes_its_section_along(bar, kept):
    vertices, triangles, report = edited(kept, 2.0, 3.5, 6.5, 8.0)
    assert len(vertices) == len(kept[1]) - 4
    assert report["kept_vertices"] == 16
    assert np.array_equal(ring(vertices, report, 5), kept[1][-4:])
    is_valid(*bar[:2], vertices, triangles)


def test_several_edits_at_once(bar, kept):
    vertices, triangles, report = edited(kept, 2.3, 3.0, 3.7, 6.5, 8.0)
    assert len(report["sections"]) == 7
    assert np.array_equal(ring(vertices, report, 6), kept[1][-4:])
    is_valid(*bar[:2], vertices, triangles)


def test_what_the_artist_has_moved_far_from_the_edit_stays(bar, kept):
    vertices = kept[1].copy()
    vertices[:4] -= [0.3, 0.0, 0.0]
    found, triangles, report = edited(kept, 2.0, 3.5, 5.0, 6.9, 8.0, vertices=vertices)
    assert report["kept_vertices"] > 0
    assert np.array_equal(found[:4], vertices[:4])
    is_valid(*bar[:2], found, triangles)


def test_a_symmetric_edit_of_a_symmetric_cage_is_symmetric(bar):
    generator = core.CageGenerator(*bar)
    vertices, faces, _ = generator.generate(nodes(*PLACES)).result()
    places = (2.0, 3.0, 5.0, 7.0, 8.0)
    found, _, report = generator.generate(nodes(*places), (nodes(*PLACES), vertices, faces)).result()
    assert report["kept_vertices"] == 8
    image = found[report["mirror"]] * [-1, 1, 1] + [bar[0][:, 0].min() + bar[0][:, 0].max(), 0, 0]
    assert np.abs(image - found).max() < 1e-6
    vertices[:4] -= [0.3, 0.0, 0.0]  # the artist's own
    found, _, report = generator.generate(nodes(*places), (nodes(*PLACES), vertices, faces)).result()
    assert report["kept_vertices"] == 8
    assert report["mirror"] is None
    assert np.array_equal(found[:4], vertices[:4])


@pytest.mark.parametrize("fault", ["other count", "nan", "through the skin", "turned inside out", "nothing edited"])
def test_a_cage_that_can_lend_nothing_is_grown_anew(bar, kept, fault):
    generator, before, _ = kept
    places = PLACES if fault == "nothing edited" else (2.0, 3.5, 5.4, 6.5, 8.0)
    vertices = {
        "other count": before[:-1],
        "nan": np.where(np.arange(len(before))[:, None] == 3, np.nan, before),
        "through the skin": before * [1.0, 0.5, 0.5],
        "turned inside out": before * [1.0, -1.0, 1.0],
        "nothing edited": before,
    }[fault]
    if fault == "nan":
        with pytest.raises(ValueError, match="earlier vertices"):
            edited(kept, *places, vertices=vertices)
        return
    found, _, report = edited(kept, *places, vertices=vertices)
    fresh, _, _ = generator.generate(nodes(*places)).result()
    assert report["kept_vertices"] == 0
    assert np.array_equal(found, fresh)


def test_an_edit_can_be_cancelled(kept):
    generator, before, faces = kept
    job = generator.generate(nodes(2.0, 3.5, 5.4, 6.5, 8.0), (nodes(*PLACES), before, faces))
    job.cancel()
    with pytest.raises(core.Cancelled):
        job.result()


def test_edits_of_a_character():
    """A knee is moved, gets a neighbour, and loses it; on both sides."""
    skin, faces, bones, edges = load("human_2k_53b")
    generator = core.CageGenerator(skin, faces, bones, edges, options=TRIANGLES)
    vertices, triangles, report = generator.generate().result()
    bending = [section for section in report["sections"] if section["kind"] == "bending"]
    places = np.array([section["place"] for section in bending])
    middle = 0.5 * (skin[:, 0].min() + skin[:, 0].max())
    images = places * [-1, 1, 1] + [2 * middle, 0, 0]
    lowest = int(np.argmin(np.where(places[:, 0] > middle, places[:, 1], np.inf)))
    other = int(np.linalg.norm(places - images[lowest], axis=1).argmin())
    step = 0.3 * bending[lowest]["radius"] * bending[lowest]["direction"]
    moved = places.copy()
    moved[lowest] += step
    moved[other] += step * [-1, 1, 1]
    more = places[lowest] + 3.0 * step * np.sign(step[1])
    added = np.concatenate([places, [more, more * [-1, 1, 1] + [2 * middle, 0, 0]]])
    earlier = (None, vertices, triangles)
    for given in (moved, added, moved):
        vertices, triangles, report = generator.generate(given, earlier).result()
        check(skin, vertices, triangles, report)
        assert report["kept_vertices"] > 0.6 * len(vertices)
        earlier = (given, vertices, triangles)
