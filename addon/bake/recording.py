# SPDX-License-Identifier: GPL-3.0-or-later
"""What a live rig is at each time of a bake, as a native rig has to know it: transforms, rest shapes, key values."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import skins, sync
from ..adapters import armature, positions, shape_keys, snapshot
from .live import BakeError, Skin, skins_of

Array = NDArray[np.float64]
ROTATIONS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}  # all others: rotation_euler
STILL = 1e-4  # of the character's size: what may change in what has to stand still


@dataclass
class SkinRecord:
    """One skin: its rest shape without shape keys, `#M by 3` in its own space, its place, and its keys' values."""

    skin: Skin
    base: positions.Points
    to_rig: list[Array] = field(default_factory=list)  # a time: 4 by 4
    key_values: list[list[float]] = field(default_factory=list)  # a time: one a shape key

    @property
    def is_still(self) -> bool:
        """Whether the skin stands still against the armature."""
        tolerance = 1e-6 * (1.0 + np.abs(self.to_rig[0]).max())
        return bool(np.ptp(self.to_rig, axis=0).max() <= tolerance)

    @property
    def preserves_volume(self) -> bool:
        """Whether it is posed by dual quaternions, which Blender's modifier calls Preserve Volume."""
        return self.skin.session.rig.method == "dqs"

    @property
    def weights(self) -> tuple[list[str], snapshot.Csr]:
        """Names of bones, and the weights of the bind, whose columns they are."""
        settings = self.skin.cage.cage_rig
        return [joint.name for joint in settings.joints], snapshot.read_weights(
            settings.skins[self.skin.index].snapshot
        )


@dataclass
class RigRecord:
    """One of the rigs that place vertices: its refit joints, `#J by 3` in the armature's space, and transforms."""

    cage: bpy.types.Object
    joints: Array
    influence: float
    method: str  # "lbs" or "dqs"
    transforms: list[Array] = field(default_factory=list)  # a time: #J by 4 by 4


class Recording:
    """What `add` has read of a character; raises `BakeError` where no native rig could play it."""

    def __init__(self, cage: bpy.types.Object) -> None:
        self._cage = cage
        self.source: bpy.types.Object = cage.cage_rig.armature
        self.times: list[float] = []
        self.rigs: list[RigRecord] = []
        self.skins: list[SkinRecord] = []
        self.poses: list[Array] = []  # a time: matrices of all pose bones, not refit
        self.channels: list[Array] = []  # a time: what the artist keyed of them, #bones by 10
        self.placement: list[Array] = []  # a time: location, rotation and scale of the armature object
        self.size = 0.0  # of the character

    @property
    def rotation_path(self) -> str:
        """The property that turns the armature object."""
        return ROTATIONS.get(self.source.rotation_mode, "rotation_euler")

    @property
    def weighted(self) -> set[str]:
        """Names of the bones that move any skin."""
        return {joint.name for rig in self.rigs for joint in rig.cage.cage_rig.joints if joint.weighted}

    def refit(self) -> dict[str, tuple[Array, list[Array]]]:
        """Refit joint and, a time, transform of every bone by name: of the rig that moves its joint farthest."""
        found: dict[str, tuple[Array, list[Array]]] = {}
        for rig in self.rigs:
            for k, joint in enumerate(rig.cage.cage_rig.joints):
                head = np.array(joint.head)
                here = np.linalg.norm(rig.joints[k] - head)
                if joint.name not in found or here > np.linalg.norm(found[joint.name][0] - head):
                    found[joint.name] = rig.joints[k], [transforms[k] for transforms in rig.transforms]
        return found

    def add(self, depsgraph: bpy.types.Depsgraph, time: float) -> None:
        """Read the character as it stands now, at `time`."""
        self.times.append(time)
        skins_now = skins_of(self._cage)
        for place, cage in enumerate(dict.fromkeys(skin.cage for skin in skins_now)):
            self._add_rig(place, cage, time)
        for place, skin in enumerate(skins_now):
            self._add_skin(place, skin, depsgraph, time)
        bones = self.source.evaluated_get(depsgraph)
        self.poses.append(armature.read_pose_matrices(bones))
        self.channels.append(armature.read_channels(bones))
        self.placement.append(np.array([*bones.location, *getattr(bones, self.rotation_path), *bones.scale]))

    def _add_rig(self, place: int, cage: bpy.types.Object, time: float) -> None:
        session = sync.session_of(cage)
        method = session.rig.method
        if method not in ("lbs", "dqs"):
            raise BakeError(
                f"'{cage.name}' skins in a way that Blender's Armature modifier does not know; set its method to "
                "Linear or Dual Quaternion, or bake to shape keys, Alembic or USD"
            )
        if place == len(self.rigs):
            self.rigs.append(RigRecord(cage, session.joints, session.influence, method))
            self.size = max(self.size, session.size)
        rig = self.rigs[place]
        if method != rig.method:
            raise BakeError(f"The method of '{cage.name}' changes up to frame {time:g}; let it be one throughout")
        moved = np.linalg.norm(session.joints - rig.joints, axis=1).max()
        if session.influence != rig.influence or moved > STILL * session.size:
            raise BakeError(
                f"The rest cage of '{cage.name}' or its influence changes up to frame {time:g}, so the joints "
                "have no one place; keep them still, or bake to shape keys, Alembic or USD"
            )
        rig.transforms.append(np.asarray(session.rig.transforms))

    def _add_skin(self, place: int, skin: Skin, depsgraph: bpy.types.Depsgraph, time: float) -> None:
        session, obj = skin.session, skin.obj
        rest = np.empty_like(session.snapshot.skins[skin.index].points)
        session.rig.rest_skin_into(rest, start=int(session.starts[skin.index]))
        matrix, _ = skins.to_rig(skin.cage, skin.index, depsgraph)
        base, values = positions.apply_matrix(np.linalg.inv(matrix), rest), []
        keys = obj.data.shape_keys
        if keys is not None:
            shown = keys.evaluated_get(depsgraph)
            values = [block.value for block in shown.key_blocks]
            offset = shape_keys.offsets(obj, shown, len(base))
            base = base if offset is None else base - offset
        if place == len(self.skins):
            self.skins.append(SkinRecord(skin, base))
        found = self.skins[place]
        drift = (base - found.base) @ matrix[:3, :3].T.astype(np.float32)
        if np.linalg.norm(drift, axis=1).max() > STILL * session.size:
            raise BakeError(
                f"The rest shape of '{obj.name}' changes up to frame {time:g} by more than its shape keys: by a "
                "modifier before Cage Rig, or because it moves against the armature; apply or remove the modifier, "
                "parent the skin to the armature, or bake to shape keys, Alembic or USD"
            )
        found.to_rig.append(matrix)
        found.key_values.append(values)
