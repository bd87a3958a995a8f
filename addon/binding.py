# SPDX-License-Identifier: GPL-3.0-or-later
"""What the file keeps of a rig's bind: everything that its session is made from, and what that stands on."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from .adapters import attributes, coordinates, positions, snapshot
from .session import Below, Known, Session, SessionCrash, SessionError, SkinSnapshot, Snapshot

# Kept with the posed cage's edit mesh: the rest cage (rig space) and the posed cage that belonged together when last
# synced. Undo in Edit Mode restores that mesh alone; what it remembers brings the rest cage back, whatever the pose.
MEMORY = ("cage_rig.rest", "cage_rig.posed")
MARK = "cage_rig_bind"  # on a snapshot: which bind it is of


class Damaged(SessionError):
    """What the file keeps of a bind can't be used; the message is a sentence. A rebind makes it anew."""

    fix = "rebind"

    def __init__(self, fault: object) -> None:
        super().__init__(f"what was kept of its bind can't be used ({fault}); undo, or press Rebind")


def bound_anew(cage: bpy.types.Object) -> Session:
    """A session made from what the file keeps. Raises `Damaged`."""
    try:
        return Session(read(cage))
    except SessionCrash:
        raise
    except (SessionError, attributes.Damaged) as error:
        raise Damaged(error) from error


def key(settings: bpy.types.PropertyGroup) -> str:
    """Other for every bind, and for every rig space that it is brought to."""
    return settings.bind_id + np.array(settings.rebased, np.float32).tobytes().hex()


def rest_points(settings: bpy.types.PropertyGroup, mesh: bpy.types.Mesh) -> positions.Points:
    """The points of a snapshot of the rig in today's rig space, `#V by 3`."""
    points, change = positions.read_base(mesh), np.array(settings.rebased, np.float64)
    return positions.apply_matrix(change, points) if change.any() else points


def mark(cage: bpy.types.Object) -> None:
    """Let the snapshots name the bind that they are of."""
    for owner in (cage.cage_rig, *cage.cage_rig.skins):
        if owner.snapshot is not None and owner.snapshot.library is None:
            owner.snapshot[MARK] = cage.cage_rig.bind_id


def read(cage: bpy.types.Object) -> Snapshot:
    """The bind of a rig, as arrays. Raises `attributes.Damaged`; what the numbers are is for the core to judge."""
    settings = cage.cage_rig
    for owner in (settings, *settings.skins):
        if owner.snapshot.get(MARK, settings.bind_id) != settings.bind_id:
            raise attributes.Damaged(f"'{owner.snapshot.name}' is of another bind")
    for name, matrix in [("cage", settings.cage_to_rig), *((s.snapshot.name, s.skin_to_rig) for s in settings.skins)]:
        place = np.array(matrix, np.float64)
        if not np.isfinite(place).all() or abs(np.linalg.det(place)) < 1e-30:
            raise attributes.Damaged(f"the place of '{name}' is lost")
    parts = [
        SkinSnapshot(
            rest_points(settings, skin.snapshot),
            positions.read_faces(skin.snapshot),
            snapshot.read_weights(skin.snapshot),
        )
        for skin in settings.skins
    ]
    joints = settings.joints
    return Snapshot(
        parts,
        np.array([joint.head for joint in joints], np.float64).reshape(-1, 3),
        np.array([joint.tail for joint in joints], np.float64).reshape(-1, 3),
        np.array([joint.parent for joint in joints], np.int32),
        rest_points(settings, settings.snapshot),
        positions.read_faces(settings.snapshot),
        settings.method.lower(),
        _read_known(settings),
    )


def below(cage: bpy.types.Object, lower: Session) -> Below:
    """The session of the rig that this one stands on, and which skins and joints they share."""
    settings, other = cage.cage_rig, cage.cage_rig.input.cage_rig
    skins = {skin.object: index for index, skin in enumerate(other.skins)}
    joints = {joint.name: index for index, joint in enumerate(other.joints)}
    return Below(
        lower,
        [skins.get(skin.object, -1) for skin in settings.skins],
        np.array([joints.get(joint.name, -1) for joint in settings.joints], np.int64),
    )


def _read_known(settings: bpy.types.PropertyGroup) -> Known:
    """Coordinates that were computed elsewhere: on the skins' snapshots, and what belongs to the cage on the cage's."""
    mesh = settings.snapshot
    joints = coordinates.read(mesh, "joint_coords", len(settings.joints))
    return Known(
        _read_rows(settings, "cage_coords"),
        None if joints is None else joints.T,
        _read_rows(settings, "center_coords"),
        coordinates.read_indices(mesh, "anchors"),
    )


def _read_rows(settings: bpy.types.PropertyGroup, name: str) -> NDArray[np.float32] | None:
    """Rows of all skins, or None where they are not of all."""
    columns = len(settings.snapshot.vertices)
    parts = [coordinates.read(skin.snapshot, name, columns) for skin in settings.skins]
    return None if any(part is None for part in parts) else np.concatenate(parts)


def write_known(cage: bpy.types.Object, known: Known) -> None:
    """Keep coordinates with the rig's snapshots, instead of those that were kept."""
    settings, start = cage.cage_rig, 0
    for owner in (settings, *settings.skins):
        if owner.snapshot.users > 1:  # a duplicate of the character has it too
            owner.snapshot = owner.snapshot.copy()
    for skin in settings.skins:
        end = start + len(skin.snapshot.vertices)
        for name in ("cage_coords", "center_coords"):
            rows = getattr(known, name)
            coordinates.write(skin.snapshot, name, None if rows is None else rows[start:end])
        start = end
    joints = known.joint_coords
    coordinates.write(settings.snapshot, "joint_coords", None if joints is None else joints.T)
    coordinates.write_indices(settings.snapshot, "anchors", known.anchors)
