"""The bent bar of [CTL*20] Figure 5: a stretched rest cage at three angles, with and without refit joints."""

from __future__ import annotations

from dataclasses import replace

import bpy

from blend_fixtures.bar import ANGLES, bar
from blend_fixtures.build import RigObjects, add_skin, build_bar

from . import acting, coupling
from .figures import Figure, freeze

BEND_FRAMES = {0: 0.0, 16: ANGLES[0], 32: ANGLES[1], 48: ANGLES[2]}


def bound_bar(location: tuple[float, float, float]) -> RigObjects:
    """The bar at `location`, bound, bending over the scene's frames, its cage stretched."""
    rig = build_bar()
    rig.armature.location = rig.cage.location = location
    bpy.context.view_layer.update()
    coupling.bind(rig)
    acting.animate_bend(rig, "upper", BEND_FRAMES)
    acting.set_key(rig, "Stretch", 1.0)
    return rig


def bar_figures(rig: RigObjects) -> list[Figure]:
    """Three figures with the joint left where it was, then three with the joint that follows the cage."""
    bare = _without_refit(rig)
    frames = [frame for frame in BEND_FRAMES if frame > 0]
    without, refit = [], []
    for frame, angle in zip(frames, ANGLES, strict=True):
        bpy.context.scene.frame_set(frame)
        without.append(freeze(f"{angle:.0f}°", [bare], armature=rig.armature))
        refit.append(
            freeze(
                f"{angle:.0f}°",
                rig.skins,
                cage=coupling.posed_cage(rig),
                armature=coupling.refit_armature(rig),
            )
        )
    bpy.data.objects.remove(bare)
    return without + refit


def _without_refit(rig: RigObjects) -> bpy.types.Object:
    """The stretched bar as a plain skin of the user's armature: its joint stays where it was."""
    acting.show_rest(rig, True)
    stretched = acting.evaluated_points(rig.skins[0])
    acting.show_rest(rig, False)
    character = bar()
    return add_skin(replace(character.skins[0], vertices=stretched), character.bone_names, rig.armature)
