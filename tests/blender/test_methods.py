"""Skinning methods: each one like Blender's own where Blender has it, changed at any time, and coupled alike."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from scene import Rig, bend, bind, build_bar, fat_key, fresh, native, rest, set_mesh, shown, update


def volume_preserving(rig: Rig) -> np.ndarray:
    """What Blender's Armature modifier shows with Preserve Volume."""
    rig.skin.modifiers["Armature"].use_deform_preserve_volume = True
    points = native(rig.skin)
    rig.skin.modifiers["Armature"].use_deform_preserve_volume = False
    return points


def use(rig: Rig, method: str) -> None:
    rig.settings.method = method
    update()


@pytest.mark.parametrize("angle", [0.4, 1.57, 2.5, -3.0])
def test_dqs_on_rotations_is_blenders_preserve_volume(bar: Rig, angle: float) -> None:
    use(bar, "DQS")
    bend(bar, angle)
    bend(bar, -0.3 * angle, "lower")
    bar.armature.pose.bones["lower"].location = (0.1, 0.3, -0.2)
    update()
    assert np.abs(shown(bar.skin) - volume_preserving(bar)).max() < 1e-5 * bar.size
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() > 1e-3, "and not linear skinning"


def test_dqs_twist_is_blenders_preserve_volume(bar: Rig) -> None:
    use(bar, "DQS")
    bone = bar.armature.pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    for turn in (1.0, 2.9, 3.5, 6.0):
        bone.rotation_euler = (0.2, turn, 0.1)
        update()
        assert np.abs(shown(bar.skin) - volume_preserving(bar)).max() < 1e-5 * bar.size, f"twist by {turn}"


def test_method_changes_at_any_time(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 1.2)
    linear = shown(bar.skin).copy()
    use(bar, "DQS")
    dual = shown(bar.skin).copy()
    assert np.abs(dual - linear).max() > 1e-2
    assert np.abs(fresh(bar)[0] - dual).max() < 1e-6
    use(bar, "LBS")
    assert np.array_equal(shown(bar.skin), linear)
    use(bar, "DQS")
    path = str(tmp_path / "bar.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bpy.data.objects["BarCage"].cage_rig.method == "DQS"
    assert np.abs(shown(bpy.data.objects["Bar"]) - dual).max() < 1e-6


def test_a_skin_with_preserve_volume_is_bound_with_dqs() -> None:
    objects = build_bar()
    objects.skins[0].modifiers["Armature"].use_deform_preserve_volume = True
    rig = bind(objects)
    assert rig.settings.method == "DQS"
    bend(rig, 1.3)
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 1e-5 * rig.size


@pytest.mark.parametrize("method", ["LBS", "DQS", "COR"])
def test_the_posed_cage_lands_on_a_right_angle_elbow(bar: Rig, method: str) -> None:
    use(bar, method)
    bend(bar, np.pi / 2)
    fat_key(bar, value=0.5)
    wanted = rest(bar.posed)
    wanted[13] += (0.1, -0.05, 0.08)
    set_mesh(bar.posed, wanted)
    assert np.abs(rest(bar.posed) - wanted).max() < 1e-6 * bar.size
    update()
    assert np.abs(rest(bar.posed) - wanted).max() < 2e-6 * bar.size
    assert np.isfinite(shown(bar.skin)).all()


def test_the_posed_cage_does_not_depend_on_the_method(bar: Rig) -> None:
    bend(bar, 1.2)
    posed = rest(bar.posed)
    use(bar, "DQS")
    assert np.array_equal(rest(bar.posed), posed)


def test_cor_keeps_the_volume_of_a_bend_without_a_bulge(bar: Rig) -> None:
    """At a right angle linear skinning pinches the elbow and DQS bulges; centers of rotation do neither."""
    bend(bar, np.pi / 2)
    reach = {}
    for method in ("LBS", "DQS", "COR"):
        use(bar, method)
        near = np.abs(rest(bar.skin)[:, 0]) < 0.02
        reach[method] = float(np.linalg.norm(shown(bar.skin)[near][:, :2], axis=1).max())
    assert reach["LBS"] < reach["COR"] < reach["DQS"] * 1.2
    assert np.abs(shown(bar.skin) - fresh(bar)[0]).max() < 1e-6
    fat_key(bar, value=0.7)
    assert np.isfinite(shown(bar.skin)).all()
    assert bar.settings.state == "LIVE"


@pytest.mark.parametrize("method", ["LBS", "COR"])
def test_16_bit_weights_change_at_any_time(bar: Rig, method: str, tmp_path: Path) -> None:
    use(bar, method)
    bend(bar, 1.2)
    moved = np.abs(rest(bar.cage) * (0.2, 0.6, 0.6)).max()
    fat_key(bar)
    single, posed = shown(bar.skin).copy(), rest(bar.posed)
    bar.settings.half_weights = True
    update()
    half = shown(bar.skin).copy()
    assert 0 < np.abs(half - single).max() <= 2e-4 * moved
    assert np.array_equal(rest(bar.posed), posed)
    assert np.abs(fresh(bar)[0] - half).max() < 1e-6
    path = str(tmp_path / "bar.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert np.abs(shown(bpy.data.objects["Bar"]) - half).max() < 1e-6
    bpy.data.objects["BarCage"].cage_rig.half_weights = False
    update()
    assert np.abs(shown(bpy.data.objects["Bar"]) - single).max() < 1e-6
