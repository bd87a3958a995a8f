# SPDX-License-Identifier: GPL-3.0-or-later
"""What a live rig is at each time of a bake, as a native rig has to know it: transforms, rest shapes, key values."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import health, skins, sync
from ..adapters import armature, positions, shape_keys
from .live import BakeError

Array = NDArray[np.float64]
ROTATIONS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}  # all others: rotation_euler
STILL = 1e-4  # of the character's size: what may change in what has to stand still


@dataclass
class SkinRecord:
    """One skin: its rest shape without shape keys, `#M by 3` in its own space, its place, and its keys' values."""

    obj: bpy.types.Object
    index: int  # among the rig's skins
    base: positions.Points
    to_rig: list[Array] = field(default_factory=list)  # a time: 4 by 4
    key_values: list[list[float]] = field(default_factory=list)  # a time: one a shape key

    @property
    def is_still(self) -> bool:
        """Whether the skin stands still against the armature."""
        tolerance = 1e-6 * (1.0 + np.abs(self.to_rig[0]).max())
        return bool(np.ptp(self.to_rig, axis=0).max() <= tolerance)


class Recording:
    """What `add` has read, all of it in the armature's space; raises `BakeError` where no native rig could play it."""

    def __init__(self, cage: bpy.types.Object) -> None:
        self._cage = cage
        self.source: bpy.types.Object = cage.cage_rig.armature
        self.times: list[float] = []
        self.joints = np.empty((0, 3))  # of the rig, refit, #J by 3
        self.transforms: list[Array] = []  # a time: refit T, #J by 4 by 4
        self.poses: list[Array] = []  # a time: matrices of all pose bones, not refit
        self.channels: list[Array] = []  # a time: what the artist keyed of them, #bones by 10
        self.placement: list[Array] = []  # a time: location, rotation and scale of the armature object
        self.skins: list[SkinRecord] = []
        self._influence = 1.0

    @property
    def rotation_path(self) -> str:
        """The property that turns the armature object."""
        return ROTATIONS.get(self.source.rotation_mode, "rotation_euler")

    def add(self, depsgraph: bpy.types.Depsgraph, time: float) -> None:
        """Read the rig as it stands now, at `time`."""
        session, bones = sync.session_of(self._cage), self.source.evaluated_get(depsgraph)
        self._refuse_method(session.rig.method)
        if not self.times:
            self.joints, self._influence = session.joints, session.influence
        elif session.influence != self._influence or np.abs(session.joints - self.joints).max() > STILL * session.size:
            raise BakeError(
                f"The rest cage of '{self._cage.name}' or its influence changes up to frame {time:g}, so the joints "
                "have no one place; keep them still, or bake to shape keys, Alembic or USD"
            )
        self.times.append(time)
        self.transforms.append(np.asarray(session.rig.transforms))
        self.poses.append(armature.read_pose_matrices(bones))
        self.channels.append(armature.read_channels(bones))
        self.placement.append(np.array([*bones.location, *getattr(bones, self.rotation_path), *bones.scale]))
        for place, (index, obj) in enumerate(health.live_skins(self._cage)):
            self._add_skin(place, index, obj, depsgraph)

    def _refuse_method(self, method: str) -> None:
        if method != "lbs":
            raise BakeError(
                f"'{self._cage.name}' skins by another method than Linear, which an exported rig can't; "
                "set its method to Linear, or bake to shape keys, Alembic or USD"
            )

    def _add_skin(self, place: int, index: int, obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
        session = sync.session_of(self._cage)
        rest = np.empty_like(session.snapshot.skins[index].points)
        session.rig.rest_skin_into(rest, start=int(session.starts[index]))
        matrix, _ = skins.to_rig(self._cage, index, depsgraph)
        base, values = positions.apply_matrix(np.linalg.inv(matrix), rest), []
        keys = obj.data.shape_keys
        if keys is not None:
            shown = keys.evaluated_get(depsgraph)
            values = [block.value for block in shown.key_blocks]
            offset = shape_keys.offsets(obj, shown, len(base))
            base = base if offset is None else base - offset
        if place == len(self.skins):
            self.skins.append(SkinRecord(obj, index, base))
        found = self.skins[place]
        drift = (base - found.base) @ matrix[:3, :3].T.astype(np.float32)
        if np.linalg.norm(drift, axis=1).max() > STILL * session.size:
            raise BakeError(
                f"The rest shape of '{obj.name}' changes up to frame {self.times[-1]:g} by more than its shape keys: "
                "by a modifier before Cage Rig, or because it moves against the armature; apply or remove the "
                "modifier, parent the skin to the armature, or bake to shape keys, Alembic or USD"
            )
        found.to_rig.append(matrix)
        found.key_values.append(values)
