"""Bake to a native rig: Blender's own Armature modifier plays it as the live rig, for every way to pose bones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import bpy
import numpy as np
import pytest
from baked import bake, go_to, shaped_rig, untouched, worst
from scene import Rig, bend, bind, fat_key, rest, set_mesh, update

from blend_fixtures import rigs
from blend_fixtures.biped import biped
from blend_fixtures.build import build_character
from blend_fixtures.walk import add_walk

EVERY_FRAME = range(rigs.FRAMES[0], rigs.FRAMES[-1] + 1)
# Rigs whose skin turns against the armature: an edited cage gives it another rest shape at every frame.
TURNING = {"moving_armature_object_and_free_skin", "unapplied_transforms", "skin_parented_to_a_bone"}
SHEARED = {"copies_and_limits", "targets_outside", "spline_ik", "every_inherit_scale", "no_inherited_rotation"}


def plays_alone(made: object) -> None:
    """Nothing of the copies needs the add-on or the live rig."""
    for skin in made.skins:
        kinds = [mod.type for mod in skin.modifiers]
        assert "NODES" not in kinds and kinds.count("ARMATURE") == 1
        assert skin.modifiers["Armature"].object == made.armature
        assert not [name for name in skin.data.attributes.keys() if "cage_rig" in name]  # noqa: SIM118
    for bone in made.armature.pose.bones:
        assert not bone.constraints
    inherited = {
        (bone.use_inherit_rotation, bone.use_local_location, bone.inherit_scale)
        for bone in made.armature.data.bones
        if bone.use_deform
    }
    assert inherited <= {(True, True, "FULL")}, "a scene graph that every exporter can write"
    owners = [made.armature, made.armature.data, *made.skins]
    assert not any(owner.animation_data.drivers for owner in owners if owner.animation_data)


@pytest.mark.parametrize("through", ["a root", "the skin"])
def test_frames_at_which_the_character_is_scaled_to_nothing_are_baked(bar: Rig, through: str) -> None:
    bend(bar, 1.0)
    obj = bar.skin
    if through == "a root":
        obj = bpy.data.objects.new("Root", None)
        bpy.context.scene.collection.objects.link(obj)
        bar.armature.parent = bar.skin.parent = obj
    for frame, scale in ((1, 1.0), (2, 0.0), (3, 1.0)):
        obj.scale = (scale, scale, scale)
        obj.keyframe_insert("scale", frame=frame)
    made = bake().to_native_rig(bar.cage, 1, 3)
    assert made.error < 1e-5
    assert worst(bar, made.skins, (1, 3)) < 1e-5


@pytest.mark.parametrize("name", rigs.RIGS)
def test_it_plays_as_the_live_rig(name: str) -> None:
    rig = shaped_rig(name)
    if name in TURNING:
        with untouched(), pytest.raises(bake().BakeError, match=r"rest shape of 'Limb' changes up to frame 2 .*parent"):
            bake().to_native_rig(rig.cage, 1, 25)
        return
    made = bake().to_native_rig(rig.cage, 1, 25)
    assert worst(rig, made.skins, EVERY_FRAME) < 2e-6
    assert made.error < 2e-6
    plays_alone(made)
    assert bool(made.helpers) == (name in SHEARED), "bones are added where there is shear alone"


@pytest.mark.parametrize("name", sorted(TURNING))
def test_skins_that_turn_against_the_armature_under_the_cage_of_the_bind(name: str) -> None:
    rig = bind(rigs.build_rig(name))
    made = bake().to_native_rig(rig.cage, 1, 25)
    assert worst(rig, made.skins, EVERY_FRAME) < 1e-5
    plays_alone(made)


@pytest.mark.parametrize("name", rigs.RIGS)
def test_its_own_action_plays_too_or_is_refused(name: str) -> None:
    constrained = {
        "stretch_to",
        "ik_with_pole",
        "stretchy_ik",
        "spline_ik",
        "copies_and_limits",
        "targets_outside",
    }
    rig = shaped_rig(name)
    if name in constrained | TURNING:
        with untouched(), pytest.raises(bake().BakeError, match="rest shape" if name in TURNING else "own action"):
            bake().to_native_rig(rig.cage, 1, 25, keep_action=True)
        return
    made = bake().to_native_rig(rig.cage, 1, 25, keep_action=True)
    times = [frame + 0.5 for frame in EVERY_FRAME[:-1]]
    assert worst(rig, made.skins, times) < 2e-6, "between frames as well"
    if rig.armature.animation_data and rig.armature.animation_data.action:
        assert made.armature.animation_data.action == rig.armature.animation_data.action


def test_sub_frames_are_keyed() -> None:
    rig = shaped_rig("rotation_modes")
    made = bake().to_native_rig(rig.cage, 1, 25, samples=4)
    assert worst(rig, made.skins, (3.25, 7.5, 20.75)) < 2e-6


def test_rest_bones_are_the_refit_joints_and_keep_their_orientation() -> None:
    rig = shaped_rig("ik_with_pole")
    bones = bake().to_native_rig(rig.cage, 1, 25).armature.data.bones
    joints = [joint.name for joint in rig.settings.joints]
    go_to(1)
    rig.armature.data.pose_position = "REST"
    update()
    for name in joints:
        assert (bones[name].head_local - rig.refit.pose.bones[name].head).length < 1e-5
        turn = np.array(rig.armature.data.bones[name].matrix_local.to_3x3())
        assert np.allclose(np.array(bones[name].matrix_local.to_3x3()), turn, atol=1e-5)
        assert bones[name].parent is None or bones[name].parent.name == rig.armature.data.bones[name].parent.name


def test_mirrored_bones_go_where_each_belongs() -> None:
    rig = bind(rigs.build_rig("mirrored_bones"))
    rig.armature.data.use_mirror_x = True
    set_mesh(rig.cage, rest(rig.cage) * np.float32([1.3, 1.2, 1.0]) + np.float32([0.2, 0.1, 0.1]))
    made = bake().to_native_rig(rig.cage, 1, 25)
    assert worst(rig, made.skins, EVERY_FRAME) < 2e-6
    assert made.armature.data.use_mirror_x


def test_with_its_own_action_drivers_and_constraints_are_its_own_too() -> None:
    rig = shaped_rig("driven_bones")
    limit = rig.armature.pose.bones["bone.0"].constraints.new("COPY_ROTATION")
    limit.target, limit.subtarget, limit.influence = rig.armature, "bone.1", 0.0
    made = bake().to_native_rig(rig.cage, 1, 25, keep_action=True)
    drivers = made.armature.animation_data.drivers
    assert len(drivers) == 3
    targets = {end.id for curve in drivers for variable in curve.driver.variables for end in variable.targets}
    assert targets == {made.armature} == {made.armature.pose.bones["bone.0"].constraints[0].target}


def test_the_walking_biped_in_other_proportions() -> None:
    character = biped()
    objects = build_character(replace(character, shape_keys={}))
    add_walk(objects.armature)
    rig = bind(objects)
    set_mesh(rig.cage, character.shape_keys["Short"])
    made = bake().to_native_rig(rig.cage, 1, 48)
    assert worst(rig, made.skins, (1, 12, 25, 40, 48)) < 1e-5
    assert made.armature.animation_data.action != rig.armature.animation_data.action


def test_bones_that_can_stay_connected_do(bar: Rig) -> None:
    set_mesh(bar.cage, rest(bar.cage) * np.float32([1.4, 1.0, 1.0]) + np.float32([0.3, 0.0, 0.0]))
    bend(bar, 1.1)
    made = bake().to_native_rig(bar.cage, 1, 2)
    assert made.armature.data.bones["upper"].use_connect
    assert worst(bar, made.skins, (1, 2)) < 1e-6


def test_a_face_talks_on() -> None:
    """Shape keys of the skin: one keyed, one driven by a bone and masked."""
    rig = shaped_rig("keyed_locations")
    rig.skin.shape_key_add(name="Basis", from_mix=False)
    everywhere = rig.skin.vertex_groups.new(name="Mask")
    everywhere.add(list(range(300)), 0.5, "REPLACE")
    for name, offset in (("Smile", 0.1), ("Frown", -0.07)):
        key = rig.skin.shape_key_add(name=name, from_mix=False)
        moved = rest(rig.skin)
        moved[::2] += np.float32([0.0, offset, 0.5 * offset])
        key.points.foreach_set("co", moved.ravel())
    smile, frown = list(rig.skin.data.shape_keys.key_blocks)[1:]
    for frame, value in ((1, 0.0), (13, 1.0), (25, 0.3)):
        smile.value = value
        smile.keyframe_insert("value", frame=frame)
    driver = frown.driver_add("value").driver
    variable = driver.variables.new()
    variable.name, variable.type = "turn", "TRANSFORMS"
    target = variable.targets[0]
    target.id, target.bone_target, target.transform_type = rig.armature, "bone.1", "ROT_X"
    driver.expression = "abs(turn)"
    frown.vertex_group = "Mask"
    made = bake().to_native_rig(rig.cage, 1, 25)
    assert worst(rig, made.skins, EVERY_FRAME) < 1e-5
    keys = made.skins[0].data.shape_keys
    assert not keys.animation_data.drivers
    go_to(13)
    assert keys.key_blocks["Smile"].value == 1.0 and keys.key_blocks["Frown"].value > 0.01
    assert keys.animation_data.action != rig.skin.data.shape_keys.animation_data.action


def test_weights_are_those_of_the_bind() -> None:
    rig = shaped_rig("control_bones_between")
    for group in list(rig.skin.vertex_groups):
        group.add(list(range(100)), 0.3, "REPLACE")
    rig.armature.data.bones["lift"].use_deform = True
    made = bake().to_native_rig(rig.cage, 1, 25)
    assert worst(rig, made.skins) < 1e-5
    assert "lift" not in made.skins[0].vertex_groups, "it had no part in the bind"
    sums = [sum(g.weight for g in vertex.groups) for vertex in made.skins[0].data.vertices]
    assert np.allclose(sums, 1.0, atol=1e-5), "normalised, as exporters want them"


def test_modifiers_that_stand_still_before_ours_are_in_the_rest_shape() -> None:
    rig = shaped_rig("keyed_locations")
    cast = rig.skin.modifiers.new("Cast", "CAST")
    cast.factor = 0.3
    rig.skin.modifiers.move(len(rig.skin.modifiers) - 1, 0)
    rig.skin.modifiers.new("Smooth", "SUBSURF").levels = 1
    update()
    made = bake().to_native_rig(rig.cage, 1, 25)
    assert [mod.type for mod in made.skins[0].modifiers] == ["ARMATURE", "SUBSURF"]
    assert made.skins[0].modifiers["Smooth"].show_viewport
    assert worst(rig, made.skins) < 1e-5
    cast.keyframe_insert("factor", frame=1)
    cast.factor = 0.6
    cast.keyframe_insert("factor", frame=25)
    go_to(1)
    with untouched(), pytest.raises(bake().BakeError, match="modifier before Cage Rig"):
        bake().to_native_rig(rig.cage, 1, 25)


# What Blender's Preserve Volume makes of shear and of scale along an axis, or of turns that cancel out.
VOLUME_DIFFERS = {
    "scaled_bones",
    "collapsed_bone",
    "copies_and_limits",
    "targets_outside",
    "every_inherit_scale",
    "no_inherited_rotation",
    "eight_influences",
}


@pytest.mark.parametrize("name", [name for name in rigs.RIGS if name not in TURNING])
def test_dual_quaternions_play_as_preserve_volume_or_are_refused(name: str) -> None:
    rig = shaped_rig(name)
    rig.settings.method = "DQS"
    go_to(1)
    if name in VOLUME_DIFFERS:
        with untouched(), pytest.raises(bake().BakeError, match="Preserve Volume does otherwise"):
            bake().to_native_rig(rig.cage, 1, 25)
        return
    made = bake().to_native_rig(rig.cage, 1, 25)
    assert worst(rig, made.skins, EVERY_FRAME) < 1e-5
    assert "Preserve Volume" in made.summary


def animated_cage(rig: Rig) -> None:
    fat_key(rig).keyframe_insert("value", frame=1)


def animated_influence(rig: Rig) -> None:
    for frame, value in ((1, 1.0), (25, 0.5)):
        rig.settings.influence = value
        rig.cage.keyframe_insert("cage_rig.influence", frame=frame)


def other_method(rig: Rig) -> None:
    rig.settings.method = "COR"


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (animated_cage, "'LimbCage' is animated"),
        (animated_influence, "influence changes up to frame 2"),
        (other_method, "set its method to Linear or Dual Quaternion"),
    ],
)
def test_refusals(spoil: Callable[[Rig], None], words: str) -> None:
    rig = shaped_rig("ik_with_pole")
    spoil(rig)
    go_to(1)
    with untouched(), pytest.raises(bake().BakeError, match=words):
        bake().to_native_rig(rig.cage, 1, 25)


def test_a_connected_bone_with_a_keyed_location_that_must_leave_its_parent_needs_new_keys(bar: Rig) -> None:
    bar.armature.pose.bones["upper"].keyframe_insert("location", frame=1)
    set_mesh(bar.cage, rest(bar.cage) + np.float32([0.0, 0.3, 0.0]) * (rest(bar.cage)[:, :1] > -0.5))
    with untouched(), pytest.raises(bake().BakeError, match=r"'upper'.*disconnected"):
        bake().to_native_rig(bar.cage, 1, 5, keep_action=True)
    made = bake().to_native_rig(bar.cage, 1, 5)
    assert not made.armature.data.bones["upper"].use_connect
    assert worst(bar, made.skins, (1, 5)) < 1e-6
