"""A Rigify human as a native rig: two hundred constraints and drivers become plain keys."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from baked import bake, worst
from scene import bind, rest, set_mesh
from test_rigify import file  # noqa: F401

from blend_fixtures import rigify_human


def test_it_plays_as_the_live_rig(file: Path) -> None:  # noqa: F811
    rig = bind(rigify_human.open_rigify_human(file))
    set_mesh(rig.cage, rest(rig.cage) * np.float32([1.2, 1.2, 0.8]))
    first, last = min(rigify_human.FRAMES), max(rigify_human.FRAMES)
    assert sum(len(bone.constraints) for bone in rig.armature.pose.bones) > 100
    made = bake().to_native_rig(rig.cage, first, last)
    assert made.error < 1e-5
    assert worst(rig, made.skins, range(first, last + 1)) < 1e-5
    assert not any(bone.constraints for bone in made.armature.pose.bones)
    assert not made.armature.animation_data.drivers
    assert made.helpers and all(not made.armature.data.bones[name].use_deform for name in made.helpers)
