"""Cage keys beside an action, [CTL*20] Figures 10 and 11: a punch with three of them, and a walk that grows stout.

Each character is there twice, under one action: as its bones alone play it, and with its cage keyed too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import bpy
import numpy as np
from mathutils import Matrix

from blend_fixtures import punch, walk
from blend_fixtures.biped import biped
from blend_fixtures.biped_cage import biped_loops
from blend_fixtures.build import RigObjects, build_character
from blend_fixtures.parts import Character

from . import acting, coupling
from .figures import Array, Figure, freeze

REACH = 0.28  # how much farther the fist strikes, in metres
ARM = {"forearm": (1.15, 0.30), "wrist": (1.65, 0.70), "fist": (2.6, 1.0)}  # scaled, and the share of the reach
# How much larger each loop of the trunk and the legs becomes, first from as bound and then once more.
STOUT = {"hip": 1.16, "waist": 1.36, "armpit": 1.12, "above knee": 1.18, "below knee": 1.12}
FAT = {"hip": 1.12, "waist": 1.33, "armpit": 1.09, "above knee": 1.20, "below knee": 1.13}
HAND = ("wrist", "knuckles", "tips")
PUNCH_KEYS = (7, punch.STRIKE, 21)
WALK_KEYS = (3, 17, 29, 47)


@dataclass(frozen=True)
class Act:
    """A character under one action, twice: `plain` by its bones alone, `rig` bound and keyed.

    `shown`: the picture's frames; `moved`: the cage vertices that the keys move.
    """

    name: str
    plain: RigObjects
    rig: RigObjects
    shown: Sequence[int]
    moved: Sequence[int]

    def bone_keys(self) -> list[float]:
        """Frames at which bones are keyed."""
        return key_frames(self.rig.armature)

    def cage_keys(self) -> list[float]:
        """Frames at which the cage is keyed."""
        return key_frames(self.rig.cage.data.shape_keys)


@dataclass(frozen=True)
class Strip:
    """An act, frozen: its shown frames by the bones alone, and keyed; and the cage keys, in the rest pose.

    Of the cages the part that the keys move.
    """

    act: Act
    plain: list[Figure]
    keyed: list[Figure]
    keys: list[Figure]


def punch_act(places: tuple[Matrix, Matrix]) -> Act:
    """The punch, alone and keyed at `places`; three cage keys: as bound, a stretched arm and a large fist, as bound."""
    before, strike, after = PUNCH_KEYS
    act = _act("Punch", punch.add_punch, range(1, 22, 4), _loops(["forearm", *HAND], "R"), places)
    _key(act.rig, before, "key_envelope")
    _edit(act.rig, strike, _stretched_arm)
    _key(act.rig, strike)
    _key(act.rig, after, "key_envelope")
    return act


def walk_act(places: tuple[Matrix, Matrix]) -> Act:
    """The walk, alone and keyed at `places`; the cage keyed as bound, stout, fat, and as bound again."""
    first, stout, fat, last = WALK_KEYS
    act = _act("Walk", walk.add_walk, range(5, 46, 8), _loops(FAT), places)
    _key(act.rig, first, "key_envelope")
    for frame, factors in ((stout, STOUT), (fat, FAT)):
        _edit(act.rig, frame, partial(_fattened, factors=factors))
        _key(act.rig, frame)
    _key(act.rig, last, "key_envelope")
    return act


def strip(act: Act) -> Strip:
    """What the picture shows of an act."""
    plain, keyed, keys = [], [], []
    for frame in act.shown:
        bpy.context.scene.frame_set(frame)
        plain.append(freeze(f"{frame}", act.plain.skins))
        keyed.append(freeze(f"{frame}", act.rig.skins))
    acting.show_rest(act.rig, True)
    for frame in act.cage_keys():
        bpy.context.scene.frame_set(int(frame))
        keys.append(_part(freeze(f"{frame:g}", act.rig.skins, cage=coupling.posed_cage(act.rig)), act.moved))
    acting.show_rest(act.rig, False)
    return Strip(act, plain, keyed, keys)


def key_frames(owner: bpy.types.ID) -> list[float]:
    """The frames at which anything of `owner` is keyed."""
    action = owner.animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else _slot_curves(owner)
    return sorted({round(point.co.x, 3) for curve in curves for point in curve.keyframe_points})


def _slot_curves(owner: bpy.types.ID) -> list[bpy.types.FCurve]:
    """The curves of a layered action (Blender 5) that move `owner`."""
    data = owner.animation_data
    bags = [strip.channelbag(data.action_slot) for layer in data.action.layers for strip in layer.strips]
    return [curve for bag in bags if bag is not None for curve in bag.fcurves]


def _act(
    name: str,
    add_action: Callable[[bpy.types.Object], bpy.types.Action],
    shown: Sequence[int],
    moved: Sequence[int],
    places: tuple[Matrix, Matrix],
) -> Act:
    rig = build_character(_character())
    add_action(rig.armature)
    plain = _twin(rig)
    plain.armature.matrix_world = places[0]
    rig.armature.matrix_world = rig.cage.matrix_world = places[1]
    for kind, parts in (("Plain", (*plain.skins, plain.armature)), ("Keyed", rig.all)):
        for part in parts:
            part.name = f"{name} {kind} {part.name.split('.')[0]}"
    bpy.context.view_layer.update()
    coupling.bind(rig)
    return Act(name, plain, rig, list(shown), moved)


@cache
def _character() -> Character:
    return biped()


def _twin(rig: RigObjects) -> RigObjects:
    """The skins and the armature once more, under the same action and without a cage."""
    armature = rig.armature.copy()
    skins = [skin.copy() for skin in rig.skins]
    for skin in skins:
        skin.data = skin.data.copy()
        skin.parent = skin.modifiers["Armature"].object = armature
    for part in (armature, *skins):
        bpy.context.scene.collection.objects.link(part)
    return RigObjects(skins, armature, None)


def _loops(names: Iterable[str], side: str = "") -> list[int]:
    """The vertices of these loops of the cage, on one side or on both."""
    loops = biped_loops().items()
    return sorted({v for name, loop in loops if name.split(".")[0] in names and name.endswith(side) for v in loop})


def _part(figure: Figure, vertices: Sequence[int]) -> Figure:
    """The figure with only these `vertices` of its cage."""
    number = {vertex: k for k, vertex in enumerate(vertices)}
    faces = [[number[v] for v in face] for face in figure.cage_faces if number.keys() >= set(face)]
    return replace(figure, cage_vertices=figure.cage_vertices[list(vertices)], cage_faces=faces)


def _key(rig: RigObjects, frame: int, operator: str = "key_cage") -> None:
    """Go to the frame and press Key Cage, or Key Envelope."""
    bpy.context.scene.frame_set(frame)
    bpy.context.view_layer.objects.active = rig.cage
    getattr(bpy.ops.cage_rig, operator)()
    bpy.context.view_layer.objects.active = None
    coupling.require_live(rig)


def _edit(rig: RigObjects, frame: int, change: Callable[[Array], Array]) -> None:
    """Go to the frame and move the posed cage's vertices in Edit Mode."""
    bpy.context.scene.frame_set(frame)
    coupling.edit_posed_cage(rig, change)


def _stretched_arm(points: Array) -> Array:
    """The right arm drawn along its forearm, and its fist enlarged."""
    parts = {"forearm": ["forearm"], "wrist": ["wrist"], "fist": ["knuckles", "tips"]}
    middles = {name: points[_loops(loops, "R")].mean(axis=0) for name, loops in parts.items()}
    along = middles["wrist"] - middles["forearm"]
    changed = points.copy()
    for name, (factor, share) in ARM.items():
        moved = _loops(parts[name], "R")
        changed[moved] = middles[name] + factor * (points[moved] - middles[name])
        changed[moved] += share * REACH * along / np.linalg.norm(along)
    return changed


def _fattened(points: Array, *, factors: dict[str, float]) -> Array:
    """The trunk's loops scaled about their middles, the legs' about their inner sides."""
    changed = points.copy()
    for name, loop in biped_loops().items():
        pivot = points[loop[:2] if "knee" in name else loop].mean(axis=0)
        changed[loop] = pivot + factors.get(name.split(".")[0], 1.0) * (points[loop] - pivot)
    return changed
