"""The gallery of generated cages, and a cage at work."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator

import bpy
import cast
import driver
import numpy as np
import stage
from mathutils import Matrix, Vector
from stage import LOOK

from blend_fixtures.build import add_shape_key
from blend_fixtures.uncaged import Uncaged

Acts = Iterator[float | None]


def everyone() -> Acts:
    """Generated cages of the project's characters and of those beside it, placed automatically and at the joints."""
    names = [name for name in os.environ.get("CAGE_RIG_GALLERY", "").split(",") if name]
    for name, build in cast.everyone().items():
        if not names or name in names:
            yield from one_of_gallery(name, build)


def one_of_gallery(name: str, build: Callable[[], Uncaged]) -> Acts:
    skins, armature = stage.start_with(build)
    yield LOOK
    caging, cages = sys.modules["bl_ext.user_default.cage_rig"].caging, {}
    for placement in ("AUTOMATIC", "JOINTS") if armature else ("AUTOMATIC",):
        options = caging.Options(placement=placement)
        try:
            cages[placement] = caging.generate_cage(bpy.context, skins, armature, options)
        except caging.GenerateError as refused:
            driver.check(f"{name} {placement}", False, f"{name} {placement}: {refused}")
    if armature is not None:
        armature.hide_set(True)
    stage.turn(*cast.LOOKS.get(name, (0.0, 0.0)))
    stage.only(*skins, *cages.values())
    stage.fit()
    yield LOOK
    stage.zoom(0.95)
    yield LOOK
    box, seen = stage.around([*skins, *cages.values()], 12), []
    stage.hide(*cages.values())
    for left, cage in zip(range(len(cages) - 1, -1, -1), cages.values(), strict=True):
        cage.hide_set(False)
        stage.only(cage)
        yield LOOK
        seen.append(f"cage_{name}_before" if left else f"cage_{name}")
        stage.picture(seen[-1], box, side_by_side=seen[:-1])
        cage.hide_set(True)
    if f"cage_{name}_at_work" in cast.BENDS:
        cages["JOINTS"].hide_set(False)
        yield from at_work(f"cage_{name}_at_work", skins, armature, cages["JOINTS"])


def at_work(
    name: str,
    skins: list[bpy.types.Object],
    armature: bpy.types.Object,
    cage: bpy.types.Object,
) -> Acts:
    """Bound: elbows bent to a right angle, then the belly fattened by its cage vertices."""
    bend = cast.BENDS[name]
    armature.hide_set(False)
    stage.only(*skins, armature, cage, active=cage)
    bpy.ops.cage_rig.bind()
    armature.data.pose_position = "POSE"
    armature.animation_data_clear()
    for bone in armature.pose.bones:
        bone.matrix_basis.identity()
    made = cage.cage_rig
    stage.hide(cage, armature, made.refit_armature)
    stage.only(made.posed_cage)
    yield LOOK
    for forearm in bend.forearms:
        bone = armature.pose.bones[forearm]
        along = bone.parent.vector.normalized()
        raised = Vector((0.0, 0.0, 1.0)) - along.z * along
        turn = bone.vector.rotation_difference(raised).to_matrix().to_4x4()
        head = Matrix.Translation(bone.head)
        bone.matrix = head @ turn @ head.inverted() @ bone.matrix
    yield LOOK
    box = stage.around([made.posed_cage], 40)
    stage.picture(f"{name}_before", box)
    points = stage.points(cage)
    groups = {group.index for group in cage.vertex_groups if group.name.startswith(bend.belly)}
    belly = np.array([any(g.group in groups for g in vertex.groups) for vertex in cage.data.vertices])
    points[belly] *= bend.fat
    add_shape_key(cage, "Fat", points).value = 1.0
    yield LOOK
    stage.picture(name, box, side_by_side=[f"{name}_before"])
