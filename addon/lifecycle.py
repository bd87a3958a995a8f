# SPDX-License-Identifier: GPL-3.0-or-later
"""Bind, rebind and unbind: everything is read and computed first, and only then is anything written."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, is_dataclass, replace
from functools import partial
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from . import applied, binding, layers, migration, reading, sync
from .adapters import armature, attributes, positions, shape_keys, stack
from .installation import Bound, install, leave, remove_mesh, remove_object
from .reading import BindError
from .session import BindJob, Known, Session, SessionError, Snapshot

Matrix = NDArray[np.float64]


def bind(
    context: bpy.types.Context,
    cage: bpy.types.Object,
    armature_object: bpy.types.Object,
    skins: list[bpy.types.Object],
    *,
    known: Known | None = None,
    source: str = "",
) -> None:
    """Bind skins, armature and cage into a rig that is live from now on. Object Mode.

    Where another rig of this armature deforms one of the skins already, the new one stands on it. What is `known`, from
    a `source` that the artist is told, is not computed. Raises `BindError`, with nothing changed, where it can't be.
    """
    plan = _plan_bind(context, cage, armature_object, *skins, known=known or Known(), source=source)
    plan.write(context, _compute(cage, plan.bound))


def rebind(context: bpy.types.Context, cage: bpy.types.Object) -> str:
    """Take the present meshes, weights and rest bones as the new rest; keep keys and settings. Object Mode.

    Skins that were deleted are forgotten. Coordinates that were loaded stay while the rest shape is what they were
    loaded for; returns a sentence on those that did not. Raises `BindError`, with nothing changed, where it can't be.
    """
    plan = _plan_rebind(context, cage)
    return plan.write(context, _compute(cage, plan.bound))


def begin_bind(
    context: bpy.types.Context,
    cage: bpy.types.Object,
    armature_object: bpy.types.Object,
    skins: list[bpy.types.Object],
) -> Work:
    """Begin to `bind` in a thread."""
    return Work(context, _plan_bind, cage, armature_object, *skins)


def begin_rebind(context: bpy.types.Context, cage: bpy.types.Object) -> Work:
    """Begin to `rebind` in a thread; the rig goes on as it is until then."""
    return Work(context, _plan_rebind, cage)


@dataclass(frozen=True)
class _Plan:
    """A bind that is read and not refused."""

    bound: Bound
    write: Callable[[bpy.types.Context, Session], str]  # returns a sentence that the artist should know, or nothing


class Work:
    """A bind under way: all is read, the core computes in a thread, nothing is written. Dropped, it is cancelled."""

    def __init__(
        self, context: bpy.types.Context, plan: Callable[..., _Plan], cage: bpy.types.Object, *others: bpy.types.Object
    ) -> None:
        self.name = cage.name
        self._read, self._objects = plan, [obj.session_uid for obj in (cage, *others)]
        self._plan = plan(context, cage, *others)
        with _refusals(self.name):
            self.job = BindJob(self._plan.bound.snapshot)

    def finish(self, context: bpy.types.Context, *, later: bool) -> tuple[bpy.types.Object, str]:
        """Wait for the core and write: the rig's cage, and a sentence that the artist should know, or nothing.

        `later`: others may have worked since it began, so everything is read again. Raises `BindError`, with nothing
        changed, where it is not what it was.
        """
        with _refusals(self.name):
            session = self.job.result()
        there = {obj.session_uid: obj for obj in bpy.data.objects if not later or obj.users_collection}
        found = [there.get(uid) for uid in self._objects]
        plan = self._plan
        if later:
            whole = context.mode == "OBJECT" and None not in found
            plan = self._read(context, *found) if whole else None
        if plan is None or not _same(plan.bound, self._plan.bound):
            raise BindError(
                f"'{self.name}', its armature or its skins were changed while they were being bound, so nothing was "
                "bound; bind again"
            )
        return found[0], plan.write(context, session)


def _plan_bind(
    context: bpy.types.Context,
    cage: bpy.types.Object,
    armature_object: bpy.types.Object,
    *skins: bpy.types.Object,
    known: Known | None = None,
    source: str = "",
) -> _Plan:
    method = "LBS" if _is_copy(cage) else cage.cage_rig.method
    lower = _rig_below(armature_object, skins)
    if lower is not None:
        method = lower.cage_rig.method
    elif all(stack.preserves_volume(obj, armature_object) for obj in skins):
        method = "DQS"
    bound = _read(context, cage, armature_object, skins, method)
    bound = replace(bound, snapshot=replace(bound.snapshot, known=known or Known()))

    return _Plan(
        bound, partial(_write_bind, cage=cage, objects=(armature_object, lower, skins), bound=bound, source=source)
    )


def _write_bind(
    context: bpy.types.Context,
    session: Session,
    *,
    cage: bpy.types.Object,
    objects: tuple[bpy.types.Object, bpy.types.Object | None, tuple[bpy.types.Object, ...]],
    bound: Bound,
    source: str,
) -> str:
    if cage.cage_rig.state != "NONE":
        unbind(cage)  # a copy of a bound cage starts anew
    settings = cage.cage_rig
    settings.version, settings.coordinates, settings.method = migration.VERSION, source, bound.snapshot.method.upper()
    settings.armature, settings.input, skins = objects
    for obj in skins:
        settings.skins.add().object = obj
    try:
        install(context, cage, bound, session)
    except Exception:
        unbind(cage)
        raise
    return ""


def _plan_rebind(context: bpy.types.Context, cage: bpy.types.Object) -> _Plan:
    settings = cage.cage_rig
    _refuse_foreign(cage)
    applied.settle(cage)
    if settings.armature is None or not settings.armature.users_collection:
        raise BindError(f"The armature of '{cage.name}' was deleted; undo, or Unbind and bind with another")
    if settings.posed_cage is not None and settings.posed_cage.cage_rig.owner != cage:
        raise BindError(f"'{cage.name}' is a copy of another rig's cage; Unbind it, then bind it")
    skins = [obj for obj in layers.skins_of(cage) if obj.users_collection]
    if not skins:
        raise BindError(f"All skins of '{cage.name}' were deleted or applied; undo, or Unbind")
    bound, before = _read(context, cage, settings.armature, skins, settings.method), settings.coordinates
    fits = bool(before) and _same_rest(cage, bound)
    if fits:
        bound = replace(bound, snapshot=replace(bound.snapshot, known=binding.read(cage).known))
    return _Plan(bound, partial(_write_rebind, cage=cage, skins=skins, bound=bound, fits=fits))


def _write_rebind(
    context: bpy.types.Context,
    session: Session,
    *,
    cage: bpy.types.Object,
    skins: list[bpy.types.Object],
    bound: Bound,
    fits: bool,
) -> str:
    settings, before = cage.cage_rig, cage.cage_rig.coordinates
    for index in reversed(range(len(settings.skins))):
        if settings.skins[index].object not in skins:
            remove_mesh(settings.skins[index].snapshot)
            settings.skins.remove(index)
    settings.coordinates = before if fits else ""
    install(context, cage, bound, session)
    if fits or not before:
        return ""
    return f"The rest shape has changed, so the coordinates of '{before}' were dropped and computed anew"


def use_coordinates(context: bpy.types.Context, cage: bpy.types.Object, known: Known, source: str) -> None:
    """Let the rig use coordinates for its bind that were computed elsewhere (`Known()`: its own), at once.

    `source` is what the artist is told of them. Raises `BindError`, with nothing changed, where it can't.
    """
    settings = cage.cage_rig
    _refuse_foreign(cage)
    if settings.snapshot is None or any(skin.snapshot is None for skin in settings.skins):
        raise BindError(f"What was bound of '{cage.name}' is lost; press Rebind")
    try:
        session = Session(replace(binding.read(cage), known=known))
    except SessionError as error:
        raise BindError(f"'{cage.name}' can't use these coordinates: {error}") from error
    binding.write_known(cage, known)
    settings.coordinates, settings.bind_id = source, uuid.uuid4().hex
    binding.mark(cage)
    sync.start(cage, context.evaluated_depsgraph_get(), session)


def _same_rest(cage: bpy.types.Object, bound: Bound) -> bool:
    """Whether skins, joints and cage rest where they did when the rig was bound."""
    settings, now = cage.cage_rig, bound.snapshot
    if any(skin.snapshot is None for skin in settings.skins) or settings.snapshot is None:
        return False
    try:
        then = binding.read(cage)
    except attributes.Damaged:
        return False
    pairs = [(then.cage, now.cage), (then.heads, now.heads), (then.parents, now.parents)]
    pairs += [(one.points, other.points) for one, other in zip(then.skins, now.skins, strict=False)]
    same = (
        then.known.is_finite
        and len(then.skins) == len(now.skins)
        and [joint.name for joint in settings.joints] == bound.bone_names
    )
    return same and all(np.array_equal(one, other) for one, other in pairs)


def unbind(cage: bpy.types.Object) -> None:
    """Put everything back as it was before the bind and forget the rig. What stood on it stands on what is below.

    Raises `BindError`, with nothing changed, for a rig of another file.
    """
    settings = cage.cage_rig
    _refuse_foreign(cage)
    applied.settle(cage)
    sync.drop(cage)
    owned = settings.posed_cage is None or settings.posed_cage.cage_rig.owner == cage
    for upper in [obj for obj in bpy.data.objects if obj.cage_rig.input == cage]:
        upper.cage_rig.input = settings.input
    for skin in settings.skins:
        if owned and skin.object is not None:
            leave(skin.object, cage)
        if owned:
            remove_mesh(skin.snapshot)
    if owned:
        stack.restore_suspended(cage)
        remove_mesh(settings.snapshot)
        for obj in (settings.posed_cage, settings.refit_armature):
            remove_object(obj)
    cage.property_unset("cage_rig")
    sync.drop(cage)


def apply_refit(context: bpy.types.Context, cage: bpy.types.Object) -> int:
    """Move the armature's rest bones to the refit joints of a still cage; returns how many moved. Object Mode.

    Orientations are kept, so that actions keep their meaning and the motion stays what it is; bones that leave their
    parent's tail are disconnected. The rig stays bound as it was. Raises `BindError` with nothing changed.
    """
    settings = cage.cage_rig
    obj = settings.armature
    if settings.state != "LIVE":
        raise BindError(f"'{cage.name}' is not live: {settings.message}")
    if obj.library or obj.data.library or obj.override_library or obj.data.override_library:
        raise BindError(f"Armature '{obj.name}' is linked from another file, so its rest bones can't be moved")
    upper = [other.name for other in bpy.data.objects if other.cage_rig.input == cage]
    if upper:
        raise BindError(f"'{upper[0]}' stands on '{cage.name}' and moves its joints on; apply the refit of that one")
    animated = next((layer for layer in (cage, *layers.below(cage)) if shape_keys.is_animated(layer)), None)
    if animated is not None:
        raise BindError(
            f"The rest cage '{animated.name}' is animated, so its joints have no one place; "
            "remove its keys, drivers and modifiers, or apply them, and try again"
        )
    rest = armature.read_rest(obj.data)
    heads = dict(zip(rest.names, rest.heads, strict=True))
    joints = sync.refit_joints(cage)
    size = float(np.linalg.norm(np.ptp(joints, axis=0))) + 1e-12
    places = {joint.name: place for joint, place in zip(settings.joints, joints, strict=True)}
    moved = {name: place for name, place in places.items() if np.linalg.norm(place - heads[name]) > 1e-6 * size}
    if not moved:
        return 0
    heads |= moved
    keyed = armature.keyed_location(obj, armature.leaves_parent(obj.data, heads))
    if keyed:
        raise BindError(
            f"Bone '{keyed}' of '{obj.name}' has to be disconnected, which would bring its keyed location to life; "
            "delete its location keys and try again"
        )
    armature.move_heads(obj, context, heads)
    for layer in (cage, *layers.below(cage)):
        for joint in layer.cage_rig.joints:
            joint.shift = heads[joint.name] - np.array(joint.head)
    context.view_layer.update()
    return len(moved)


def summary(cage: bpy.types.Object) -> str:
    """One sentence on what was bound, and what the bind found that the artist should know."""
    settings, report = cage.cage_rig, sync.report(cage)
    if settings.state == "PAUSED":
        return settings.message
    vertices = sum(len(skin.snapshot.vertices) for skin in settings.skins)
    text = (
        f"Bound '{cage.name}' ({len(settings.snapshot.vertices)} vertices) to {len(settings.skins)} skin(s) "
        f"({vertices} vertices) and {len(settings.joints)} bones"
    )
    if settings.input is not None:
        text += f", on top of '{settings.input.name}'"
    missed = report.get("vertices_outside", 0)
    if missed:
        text += f". {missed} skin vertices are outside the cage, which moves them less the farther they are"
    outside = [settings.joints[k].name for k in report.get("joints_outside_hull", [])]
    if outside:
        named = ", ".join(f"'{name}'" for name in outside[:3]) + (" and others" if len(outside) > 3 else "")
        text += f". Outside the cage: {named}"
    return text


def _is_copy(obj: bpy.types.Object) -> bool:
    """Whether a cage that may be bound is a copy of a bound one. Raises `BindError` where it may not."""
    settings = obj.cage_rig
    if settings.state != "NONE":
        owner = settings.posed_cage.cage_rig.owner if settings.posed_cage else obj
        if owner not in (None, obj):
            return True
        raise BindError(f"'{obj.name}' is the cage of a rig already; press Rebind, or Unbind it first")
    if settings.part != "NONE" and settings.owner is not None:
        raise BindError(f"'{obj.name}' belongs to the rig of cage '{settings.owner.name}'; Unbind that first")
    if obj.library is not None or obj.data.library is not None:
        raise BindError(f"'{obj.name}' is linked from another file; make it local first")
    return False


def _rig_below(armature_object: bpy.types.Object, skins: tuple[bpy.types.Object, ...]) -> bpy.types.Object | None:
    """The rig that deforms skins of the selection already, on which a new one would stand."""
    lower: bpy.types.Object | None = None
    for obj in skins:
        settings = obj.cage_rig
        if obj.library is not None:
            raise BindError(f"'{obj.name}' is linked from another file; make a library override or make it local")
        if settings.state != "NONE":
            raise BindError(f"'{obj.name}' is the cage of a rig; Unbind it first, or leave it out of the selection")
        if settings.part == "NONE" or settings.owner is None:
            continue
        shared = obj in layers.skins_of(settings.owner) and settings.owner.cage_rig.armature == armature_object
        if settings.part != "SKIN" or not shared:
            raise BindError(f"'{obj.name}' belongs to the rig of cage '{settings.owner.name}'; Unbind that first")
        if lower not in (None, settings.owner):
            raise BindError(
                f"The skins belong to the rigs of '{lower.name}' and '{settings.owner.name}'; bind a cage to one only"
            )
        lower = settings.owner
    return lower


def _refuse_foreign(cage: bpy.types.Object) -> None:
    if cage.library is not None or cage.override_library is not None:
        raise BindError(f"'{cage.name}' was bound in another file; open that one to bind anew, or delete it here")
    trouble = migration.problem(cage)
    if trouble:
        raise BindError(trouble)


def _read(
    context: bpy.types.Context,
    cage: bpy.types.Object,
    armature_object: bpy.types.Object,
    skins: Sequence[bpy.types.Object],
    method: str,
) -> Bound:
    found = reading.read(context, armature_object, skins, cage)
    rest, to_rig = found.rest, found.to_rig
    core = Snapshot(
        found.skins,
        rest.heads.astype(np.float32).astype(np.float64),
        rest.tails.astype(np.float32).astype(np.float64),
        rest.parents,
        positions.apply_matrix(to_rig[-1], positions.read_base(cage.data)),
        positions.read_faces(cage.data),
        method.lower(),
    )
    return Bound(core, rest.names, to_rig[:-1], to_rig[-1])


def _same(one: Any, other: Any) -> bool:
    """Whether two binds have read the same, to the last bit."""
    if is_dataclass(one):
        return _same(list(vars(one).values()), list(vars(other).values()))
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(np.array_equal(one, other))


def _compute(cage: bpy.types.Object, bound: Bound) -> Session:
    """Let the core bind: what it refuses is refused before anything is written."""
    with _refusals(cage.name):
        return Session(bound.snapshot)


@contextmanager
def _refusals(name: str) -> Iterator[None]:
    try:
        yield
    except SessionError as error:
        raise BindError(f"'{name}' can't be bound: {error}") from error
