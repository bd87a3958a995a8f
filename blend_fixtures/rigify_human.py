"""A Rigify human: the basic human of the Rigify add-on that ships with Blender, generated, with a skin and an action.

Written as a .blend by a process of its own (python blend_fixtures/rigify_human.py FILE, a Python with bpy), because the
bpy modules of 4.2 and 4.5 crash or hang at exit once Rigify was enabled. Rigify makes most deforming bones B-bones.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from blend_fixtures.build import RigObjects, add_cage, add_skin
from blend_fixtures.fields import Field, cone, union
from blend_fixtures.parts import Bone, Cage, Part, Skin
from blend_fixtures.skin_weights import part_weights
from blend_fixtures.surface_nets import mesh_field

FRAMES = (1, 10, 20)
_THICK = {"spine": 0.13, "pelvis": 0.12, "thigh": 0.085, "shin": 0.06, "breast": 0.09, "shoulder": 0.06}
_THIN = 0.05
_CAGE_GAP = 0.09


def open_rigify_human(path: Path, *, straight: bool = True) -> RigObjects:
    """Open the file written by `main`, at its first frame. `straight`: every bone gets one segment, so that it can be
    a source of weights.
    """
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    armature = bpy.data.objects["rig"]
    for bone in armature.data.bones if straight else []:
        bone.bbone_segments = 1
    bpy.context.scene.frame_set(FRAMES[0])
    return RigObjects([bpy.data.objects["Human"]], armature, bpy.data.objects["HumanCage"])


def main() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="rigify")
    _build()
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(sys.argv[1]).resolve()))
    sys.stdout.flush()
    os._exit(0)  # not through Blender's own exit, see above


def _build() -> None:
    armature = _generated()
    bones = [Bone(b.name, tuple(b.head_local), tuple(b.tail_local)) for b in armature.data.bones if b.use_deform]
    add_skin(_skin(bones), [bone.name for bone in bones], armature)
    vertices, faces = _surface(bones, cell=0.12, gap=_CAGE_GAP)
    add_cage("HumanCage", Cage(vertices, faces.tolist()))
    _add_action(armature)


def _generated() -> bpy.types.Object:
    """The generated rig; the metarig it came from is removed."""
    bpy.ops.object.armature_basic_human_metarig_add()
    metarig = bpy.context.object
    bpy.ops.pose.rigify_generate()
    bpy.ops.object.mode_set(mode="OBJECT")
    rig = metarig.data.rigify_target_rig
    bpy.data.objects.remove(metarig)
    rig.select_set(False)
    return rig


def _skin(bones: Sequence[Bone]) -> Skin:
    vertices, faces = _surface(bones, cell=0.035, gap=0.0)
    part = Part("Human", vertices, faces, "", tuple(bone.name for bone in bones))
    return Skin("Human", vertices, faces, part_weights(part, bones))


def _surface(bones: Sequence[Bone], *, cell: float, gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Capsules around the bones, `gap` metres thicker → vertices (#V by 3), quads (#F by 4)."""
    ends = np.array([(bone.head, bone.tail) for bone in bones]).reshape(-1, 3)
    margin = max(_THICK.values()) + gap + 2.0 * cell
    return mesh_field(_body(bones, gap), ends.min(axis=0) - margin, ends.max(axis=0) + margin, cell=cell)


def _body(bones: Sequence[Bone], gap: float) -> Field:
    def radius(name: str) -> float:
        kind = name.removeprefix("DEF-").split(".")[0]
        neck_or_head = name in ("DEF-spine.004", "DEF-spine.005", "DEF-spine.006")
        return gap + (0.07 if neck_or_head else _THICK.get(kind, _THIN))

    return union([cone(bone.head, bone.tail, radius(bone.name)) for bone in bones], 0.03)


def _add_action(armature: bpy.types.Object) -> None:
    """Left arm and right leg by IK, the right arm from IK to FK, torso, head, a stretched tweak, the root."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    for name, path, poses in (
        ("hand_ik.L", "location", ((0, 0, 0), (0.1, -0.25, 0.3), (-0.2, 0.1, 0.4))),
        ("hand_ik.L", "rotation_euler", ((0, 0, 0), (0.3, 0.2, 0.4), (0.0, -0.5, 0.0))),
        ("foot_ik.R", "location", ((0, 0, 0), (0.0, -0.3, 0.25), (0.05, 0.3, 0.1))),
        ("foot_heel_ik.R", "rotation_euler", ((0, 0, 0), (0.5, 0.0, 0.0), (-0.3, 0.0, 0.2))),
        ("upper_arm_fk.R", "rotation_euler", ((0, 0, 0), (0.6, 0.2, 0.3), (-0.4, 0.5, 0.2))),
        ("forearm_fk.R", "rotation_euler", ((0, 0, 0), (0.8, 0.0, 0.0), (1.2, 0.0, 0.0))),
        ("torso", "location", ((0, 0, 0), (0.05, -0.1, -0.12), (0.1, 0.2, 0.05))),
        ("torso", "rotation_euler", ((0, 0, 0), (0.2, 0.1, 0.2), (-0.1, 0.0, -0.4))),
        ("chest", "rotation_euler", ((0, 0, 0), (0.1, 0.4, 0.0), (0.0, -0.3, 0.2))),
        ("head", "rotation_euler", ((0, 0, 0), (0.0, 0.7, 0.1), (0.3, -0.4, 0.0))),
        ("forearm_tweak.L", "location", ((0, 0, 0), (0.0, 0.05, 0.08), (0.05, 0.0, -0.05))),
        ("root", "location", ((0, 0, 0), (0.2, 0.5, 0.0), (0.4, 1.0, 0.0))),
    ):
        bone = armature.pose.bones[name]
        if path == "rotation_euler":
            bone.rotation_mode = "XYZ"
        _key(bone, path, poses)
    _key(armature.pose.bones["upper_arm_parent.R"], '["IK_FK"]', (0.0, 1.0, 1.0))


def _key(bone: bpy.types.PoseBone, path: str, values: Sequence[object]) -> None:
    for frame, value in zip(FRAMES, values, strict=True):
        if path.startswith("["):
            bone[path[2:-2]] = value
        else:
            setattr(bone, path, value)
        bone.keyframe_insert(path, frame=frame)


if __name__ == "__main__":
    main()
