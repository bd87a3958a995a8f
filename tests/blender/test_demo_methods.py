"""What the picture of the skinning methods claims of the arm's elbow, measured on the arm that it shows."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from scene import rest, shown

from blend_fixtures.arm import ELBOW, WRIST, arm
from blend_fixtures.build import RigObjects
from blend_fixtures.enclosure import check_cage
from blend_fixtures.parts import Cage

ROOT = Path(__file__).parents[2]


@pytest.fixture
def methods(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(str(ROOT / "demo"))
    from showcase import methods

    yield methods
    for name in [name for name in sys.modules if name.split(".")[0] == "showcase"]:
        del sys.modules[name]


@pytest.fixture
def rig(methods: ModuleType) -> RigObjects:
    return methods.bound_arm()


def test_the_cage_encloses_the_arm() -> None:
    character = arm()
    report = check_cage(character.cage, character.skins[0].vertices)
    assert report.good and report.clearance > 0.005, report


def test_linear_pinches_dqs_bulges_and_centers_of_rotation_less(methods: ModuleType, rig: RigObjects) -> None:
    rows = [methods.method_row(rig, *method) for method in methods.coupling.methods(rig)]
    assert [row.name for row in rows] == ["Linear", "Dual Quaternion", "Centers of Rotation"]
    linear, dual, centers = (row.elbow for row in rows)
    assert linear.volume < 0.92 and linear.thinnest == pytest.approx(np.cos(np.pi / 4), abs=0.02)
    for kept in (dual, centers):
        assert 0.97 < kept.volume < 1.03 and kept.thinnest > 0.98
    assert dual.thickest > 1.25
    assert linear.thickest - 1.0 < centers.thickest - 1.0 < 0.75 * (dual.thickest - 1.0)


def test_every_row_shows_one_arm_under_one_cage(methods: ModuleType, rig: RigObjects) -> None:
    rows = [methods.method_row(rig, *method) for method in methods.coupling.methods(rig)]
    for row in rows[1:]:
        for figure, first in zip(row.figures, rows[0].figures, strict=True):
            assert np.array_equal(figure.cage_vertices, first.cage_vertices)
        assert np.array_equal(row.figures[0].points(), rows[0].figures[0].points())
        assert np.abs(row.figures[1].points() - rows[0].figures[1].points()).max() > 0.01
    assert np.abs(shown(rig.skins[0]) - rest(rig.skins[0])).max() < 1e-6, "left at rest"


def test_an_arm_at_rest_measures_as_whole(methods: ModuleType, rig: RigObjects) -> None:
    elbow = methods.measure_elbow(rig)
    assert elbow.volume == pytest.approx(1.0, abs=1e-5)
    assert elbow.thinnest == pytest.approx(1.0, abs=0.02) and elbow.thickest == pytest.approx(1.0, abs=0.02)


def test_the_reshaped_arm_is_longer_within_its_cage(methods: ModuleType, rig: RigObjects) -> None:
    cage, refit = rig.cage, methods.coupling.refit_armature(rig)
    methods.acting.set_key(rig, "Long", 1.0)
    faces = [list(face.vertices) for face in cage.data.polygons]
    assert check_cage(Cage(shown(cage).astype(float), faces), shown(rig.skins[0]).astype(float)).outside == 0
    forearm = refit.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones["forearm"]
    assert (forearm.tail - forearm.head).length > 1.3 * (WRIST - ELBOW)
