"""The sample characters: made here, added as an artist adds them, alive at once."""

from __future__ import annotations

import itertools
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from scene import shown, update

from blend_fixtures import make_samples


@pytest.fixture(scope="module")
def folder(installed: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("samples")
    for sample in make_samples.SAMPLES:
        make_samples.make(sample, made / f"{sample.name.lower()}.blend")
    return made


@pytest.fixture
def samples(folder: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    import bl_ext.user_default.cage_rig.samples as samples

    monkeypatch.setattr(samples, "FOLDER", folder)
    return samples


@pytest.mark.parametrize("name", [sample.name for sample in make_samples.SAMPLES])
def test_a_sample_is_live_acts_and_changes_its_shape(samples: ModuleType, name: str) -> None:
    import bl_ext.user_default.cage_rig.keying as keying

    assert samples.names() == sorted(sample.name for sample in make_samples.SAMPLES)
    bpy.context.scene.cursor.location = (2.0, -1.0, 0.5)
    assert bpy.ops.cage_rig.add_sample(name=name) == {"FINISHED"}
    cage = bpy.context.view_layer.objects.active
    settings = cage.cage_rig
    assert settings.state == "LIVE" and settings.armature.matrix_world.translation[:] == (2.0, -1.0, 0.5)
    sample = next(sample for sample in make_samples.SAMPLES if sample.name == name)
    assert keying.frames(cage) == [float(frame) for frame in sample.cage_keys]
    skin = settings.skins[0].object
    seen = []
    for frame in (1, 13, 25, 37):
        bpy.context.scene.frame_set(frame)
        seen.append(shown(skin).copy())
        assert settings.state == "LIVE", settings.message
    assert all(np.abs(a - b).max() > 0.05 for a, b in itertools.pairwise(seen))
    assert len(samples.FOLDER.joinpath(f"{name.lower()}.blend").read_bytes()) < 4_000_000
    assert not any(obj.library or obj.data.library for obj in bpy.data.objects), "appended, not linked"


def test_two_samples_live_beside_one_another(samples: ModuleType) -> None:
    for place in (0.0, 3.0):
        bpy.context.scene.cursor.location.x = place
        assert bpy.ops.cage_rig.add_sample(name="Octopus") == {"FINISHED"}
    update()
    rigs = [obj for obj in bpy.context.scene.objects if obj.cage_rig.state != "NONE"]
    assert [rig.cage_rig.state for rig in rigs] == ["LIVE", "LIVE"]
    assert rigs[0].cage_rig.skins[0].object != rigs[1].cage_rig.skins[0].object


def test_adding_is_one_step_of_undo(samples: ModuleType) -> None:
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.cage_rig.add_sample(name="Octopus")
    bpy.ops.ed.undo_push(message="Cage Rig Sample")
    bpy.ops.ed.undo()
    assert not bpy.context.scene.objects


def test_a_missing_sample_is_refused(samples: ModuleType) -> None:
    with pytest.raises(RuntimeError, match="There is no sample 'Whale' in this installation"):
        bpy.ops.cage_rig.add_sample(name="Whale")
    assert not bpy.context.scene.objects


class Recorder:
    """What a menu's draw function puts into a layout."""

    def __init__(self) -> None:
        self.layout, self.drawn = self, []

    def menu(self, name: str, **_: object) -> None:
        self.drawn.append(name)

    def operator(self, name: str, **_: object) -> None:
        self.drawn.append(name)

    def separator(self) -> None:
        """A line."""


def test_the_menus_offer_samples_and_cages(samples: ModuleType) -> None:
    import bl_ext.user_default.cage_rig.operators as operators

    offered = {}
    for menu, draw in operators.MENUS:
        recorder = Recorder()
        draw(recorder, bpy.context)
        offered[menu.__name__] = recorder.drawn
    assert offered["VIEW3D_MT_add"] == ["CAGE_RIG_MT_samples"]
    assert offered["VIEW3D_MT_mesh_add"] == ["cage_rig.generate_cage"]
    assert offered["VIEW3D_MT_object"] == ["cage_rig.generate_cage", "cage_rig.fit_cage", "cage_rig.bind"]
