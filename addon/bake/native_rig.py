# SPDX-License-Identifier: GPL-3.0-or-later
"""To a native rig: skins, bones and an action that Blender's own Armature modifier plays as the live rig does.

For a rest cage that stands still, and the methods Linear and Dual Quaternion (as Preserve Volume). Rest skins and rest
joints are those that the cage gives, weights those of the bind. The pose is that of the refit transforms T, whatever
makes it (constraints, IK, drivers), keyed plainly: T · rest, in what each bone's parent hands on to it (`solving`).
Then the new rig is played and held against the live one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ..adapters import armature, positions, shape_keys
from ..skins import is_flat
from .drafts import draft
from .live import BakeError, Steps, playing, refuse_unready, rigs, times
from .native_bones import copy_armature, key_bones
from .native_skins import copy_skin
from .recording import Recording

TOLERANCE = 1e-4  # of the character's size: a native rig that is farther from the live one than this is refused


@dataclass(frozen=True)
class NativeRig:
    """What was made, and how far it is from the live rig: a share of the character's size, and where that is."""

    collection: bpy.types.Collection
    armature: bpy.types.Object
    skins: list[bpy.types.Object]
    error: float
    frame: float
    bone: str

    @property
    def helpers(self) -> list[str]:
        """Bones that the armature has besides those of its source: what takes the shear of others."""
        return [bone.name for bone in self.armature.data.bones if bone.get(armature.HELPER)]

    @property
    def summary(self) -> str:
        """One sentence for the artist."""
        text = f"Baked '{self.collection.name}', which plays within {self.error:.1e} of the character's size"
        if self.error > 1e-5:
            text += f" (farthest at bone '{self.bone}', frame {self.frame:g})"
        if any(mod.type == "ARMATURE" and mod.use_deform_preserve_volume for s in self.skins for mod in s.modifiers):
            text += "; other programs don't know its Preserve Volume and skin it linearly"
        if self.helpers:
            text += f"; {len(self.helpers)} bone(s) are added for what is sheared, as '{self.helpers[0]}'"
        return text


def steps(
    cage: bpy.types.Object, frame_start: int, frame_end: int, *, samples: int, keep_action: bool
) -> Steps[NativeRig]:
    """See `to_native_rig`."""
    refuse_unready(cage)
    animated = next((rig for rig in rigs(cage) if shape_keys.is_animated(rig)), None)
    if animated is not None:
        raise BakeError(
            f"The rest cage '{animated.name}' is animated, so its joints have no one place; remove its keys, drivers "
            "and modifiers, or apply them, or bake to shape keys, Alembic or USD"
        )
    at = times(frame_start, frame_end, samples=samples)
    with draft() as made, playing(cage, at[0]) as go:
        seen = Recording(cage)
        for index, time in enumerate(at):
            seen.add(go(time), time)
            yield 0.4 * (index + 1) / len(at)
        bones = copy_armature(made, seen, keep_action=keep_action)
        if not keep_action:
            yield from (0.4 + 0.2 * share for share in key_bones(made, bones, seen))
        natives = [copy_skin(made, skin, bones, seen) for skin in seen.skins]
        collection = made.finish(f"{cage.name} Native")
        with _alone(natives, bones):
            worst = (0.0, at[0], "")
            for index, time in enumerate(at):
                here = _difference(seen, natives, go(time), time)
                _refuse_far(here, seen, keep_action=keep_action)
                worst = max(worst, here)
                yield 0.6 + 0.4 * (index + 1) / len(at)
        return NativeRig(collection, bones, natives, *worst)


@contextmanager
def _alone(natives: list[bpy.types.Object], bones: bpy.types.Object) -> Iterator[None]:
    """Modifiers after the new Armature modifiers off: what comes before is what has to match."""
    hidden = []
    for obj in natives:
        mods = list(obj.modifiers)
        ours = next(index for index, mod in enumerate(mods) if mod.type == "ARMATURE" and mod.object == bones)
        hidden += [mod for mod in mods[ours + 1 :] if mod.show_viewport]
    for mod in hidden:
        mod.show_viewport = False
    yield
    for mod in hidden:
        mod.show_viewport = True


def _difference(
    seen: Recording, natives: list[bpy.types.Object], depsgraph: bpy.types.Depsgraph, time: float
) -> tuple[float, float, str]:
    """How far the new skins are from the live ones now, as a share of the character's size, and the bone there.

    What is scaled to nothing differs in nothing.
    """
    bones = armature.to_array(seen.source.evaluated_get(depsgraph).matrix_world)
    worst = (0.0, time, "")
    for skin, obj in zip(seen.skins, natives, strict=True):
        world = armature.to_array(obj.evaluated_get(depsgraph).matrix_world)
        if is_flat(world):
            continue
        placed = skin.to_rig[seen.times.index(time)] if is_flat(bones) else np.linalg.inv(bones) @ world
        native = positions.apply_matrix(placed, positions.read_evaluated(obj, depsgraph))
        live = skin.skin.session.posed_skin(skin.skin.index)
        off = np.linalg.norm(native - live, axis=1) / seen.size
        vertex = int(off.argmax())
        names, (indptr, columns, values) = skin.weights
        mine = slice(indptr[vertex], indptr[vertex + 1])
        bone = names[columns[mine][values[mine].argmax()]] if len(columns[mine]) else ""
        if not off[vertex] <= worst[0]:  # also where it is no number
            worst = float(off[vertex]), time, bone
    return worst


def _refuse_far(found: tuple[float, float, str], seen: Recording, *, keep_action: bool) -> None:
    error, time, bone = found
    if error <= TOLERANCE:
        return
    off = f"off by {100.0 * error:.2g} % of the character's size at frame {time:g}, at bone '{bone}'"
    if keep_action:
        why = "constraints, IK or drivers make another motion of its own action; bake a new one"
    elif any(skin.preserves_volume for skin in seen.skins):
        why = "Blender's Preserve Volume does otherwise with what is scaled there; set the method to Linear"
    else:
        why = "location, rotation and scale can't make its motion; bake to shape keys, Alembic or USD"
    raise BakeError(f"The native rig would be {off}: {why}")
