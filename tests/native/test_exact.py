"""The checks of cages are themselves checked: what meets is found, down to the last bit, and nothing else."""

import exact
import numpy as np
import pytest

UPRIGHT = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
ONE = np.array([[0, 1, 2]])


def meet(points):
    return len(exact.meeting(UPRIGHT, ONE, np.asarray(points, float), ONE)) == 1


def test_a_triangle_through_another_one_meets_it():
    assert meet([[0.2, 0.2, -1], [0.2, 0.2, 1], [5, 5, 1]])
    assert not meet([[2, 2, -1], [2, 2, 1], [5, 5, 1]])


@pytest.mark.parametrize("height", [0.0, 5e-324, -5e-324, 1e-300])
def test_a_touch_is_told_from_the_least_gap(height):
    touching = [[0.1, 0.1, height], [0.1, 0.3, height + 1], [0.3, 0.1, 1]]
    assert meet(touching) == (height <= 0)


def test_triangles_in_one_plane_meet_where_they_overlap():
    assert meet([[0.1, 0.1, 0], [0.2, 0.1, 0], [0.1, 0.2, 0]])
    assert meet([[1, 0, 0], [2, 0, 0], [2, 1, 0]])
    assert not meet([[1.5, 0, 0], [2, 0, 0], [2, 1, 0]])


def test_neighbours_meet_only_where_they_overlap():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.2, 0.2, 0], [-1, -1, 0.0]])
    assert not len(exact.self_meeting(points, np.array([[0, 1, 2], [1, 3, 2]])))
    assert len(exact.self_meeting(points, np.array([[0, 1, 2], [1, 4, 2]])))
    assert len(exact.self_meeting(points, np.array([[0, 1, 2], [0, 3, 4]])))


def test_the_distance_is_that_of_the_nearest_points():
    above = UPRIGHT + np.array([0.1, 0.1, 0.25])
    assert exact.nearer(UPRIGHT, ONE, above, ONE, 1.0) == pytest.approx(0.25)
    crossed = np.array([[0.5, -0.5, 0.1], [0.5, -2, 0.1], [0.5, -1, 3]])
    assert exact.nearer(UPRIGHT, ONE, crossed, ONE, 1.0) == pytest.approx(np.hypot(0.5, 0.1))
    assert exact.nearer(UPRIGHT, ONE, above + 5, ONE, 1.0) == 1.0
    point = np.array([[0.2, 0.2, 0.5]] * 3)
    assert exact.nearer(UPRIGHT, ONE, point, ONE, 1.0) == pytest.approx(0.5)


def test_a_closed_mesh_winds_once_around_what_is_inside():
    points = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]])
    faces = np.array([[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]])
    places = np.array([[0.1, 0.1, 0.1], [1, 1, 1]])
    assert exact.winding(places, points, faces) == pytest.approx([1, 0])
