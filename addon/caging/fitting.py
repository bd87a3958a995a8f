# SPDX-License-Identifier: GPL-3.0-or-later
"""A rough cage, made by hand or decimated from the skin, that is made to fit: its vertices move, all else stays."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import reading
from ..adapters import picks, positions, stack
from ..generator import ROUGH, Cage, Faces, Job, Points, Refusal
from . import character as characters
from . import refusals, result
from .character import Character
from .options import Options
from .refusals import GenerateError

NAMED = re.compile(r"(\w+) (\d+)(?:(?:-| and )(\d+))?")  # "edge 3-4", in sentences of the core


@dataclass(frozen=True)
class _Rough:
    """A cage that is about where it is to be, in rig space."""

    cage: bpy.types.Object
    points: Points
    faces: Faces
    to_rig: NDArray[np.float64]


class Fitting:
    """A fit under way: all is read, the core works in a thread, nothing is written. Dropped, it is cancelled."""

    def __init__(
        self,
        context: bpy.types.Context,
        cage: bpy.types.Object,
        skins: list[bpy.types.Object],
        armature: bpy.types.Object | None,
        options: Options,
    ) -> None:
        """Object Mode. Raises `GenerateError`."""
        self.name, self._options = cage.name, options
        self._objects = [None if obj is None else obj.session_uid for obj in (cage, armature, *skins)]
        self._found, self._rough = _read(context, cage, skins, armature, options)
        try:
            self.job: Job = self._found.generator.fit(self._rough.points, self._rough.faces)
        except Refusal as refusal:
            raise GenerateError(f"'{cage.name}' can't be fitted: {refusal}") from refusal

    def finish(
        self, context: bpy.types.Context, *, later: bool = False, tell: Callable[[str], object] | None = None
    ) -> bpy.types.Object:
        """Wait for the core and move the vertices. Selects what Bind needs, and tells a sentence on what was done.

        `later`: others may have worked since it began, so everything is read again. Raises `GenerateError`, with
        nothing changed, or `Cancelled`.
        """
        try:
            made = self.job.result()
        except Refusal as refusal:
            raise _explained(refusal, self._rough, self._found.scene) from refusal
        if later:
            self._read_again(context)
        cage, back = self._rough.cage, np.linalg.inv(self._rough.to_rig)
        positions.move(cage.data, made.points @ back[:3, :3].T + back[:3, 3])
        result.select(context, cage, self._found)
        if tell is not None:
            tell(_summary(cage, made, self._found))
        return cage

    def _read_again(self, context: bpy.types.Context) -> None:
        """Undo may have put other objects in the place of those that were read. Raises `GenerateError`."""
        there = {obj.session_uid: obj for obj in bpy.data.objects if obj.users_collection}
        cage, armature, *skins = (there.get(uid) for uid in self._objects)
        whole = context.mode == "OBJECT" and None not in (cage, *skins) and (armature is None) == (not self._objects[1])
        if whole:
            found, rough = _read(context, cage, skins, armature, self._options)
            whole = found.generator.given.key == self._found.generator.given.key and _same(rough, self._rough)
        if not whole:
            raise GenerateError(
                f"'{self.name}', its armature or its skins were changed while it was fitted, so it was left as it is; "
                "fit it again"
            )
        self._found, self._rough = found, rough


def fit_cage(
    context: bpy.types.Context,
    cage: bpy.types.Object,
    skins: list[bpy.types.Object],
    armature: bpy.types.Object | None,
    options: Options | None = None,
    *,
    tell: Callable[[str], object] | None = None,
    watch: Callable[[Job], object] | None = None,
) -> bpy.types.Object:
    """Move the vertices of a rough cage so that it encloses the skins, closely, and crosses nothing. Object Mode.

    Without an armature (None) the core looks for a skeleton in the skin. Of `options` clearance, tightness, symmetry
    and hull count; a generated cage has its own. `tell` gets a sentence on what was done, `watch` the job while it
    works. Raises `GenerateError` with nothing changed.
    """
    fitting = Fitting(context, cage, skins, armature, options or result.options_of(cage))
    while not fitting.job.wait(0.1):
        if watch is not None:
            watch(fitting.job)
    return fitting.finish(context, tell=tell)


def _read(
    context: bpy.types.Context,
    cage: bpy.types.Object,
    skins: list[bpy.types.Object],
    armature: bpy.types.Object | None,
    options: Options,
) -> tuple[Character, _Rough]:
    _refuse(cage, skins)
    found = characters.read(context, armature, skins, options)
    try:
        to_rig = reading.placed(context, found.space, cage)
    except reading.BindError as error:
        raise GenerateError(str(error)) from error
    points = positions.read_base(cage.data).astype(float) @ to_rig[:3, :3].T + to_rig[:3, 3]
    return found, _Rough(cage, points, positions.read_faces(cage.data), to_rig)


def _refuse(cage: bpy.types.Object, skins: list[bpy.types.Object]) -> None:
    """Raise `GenerateError` where the vertices of this object can't be moved, or should not be."""
    name, mesh = cage.name, cage.data
    if cage.cage_rig.state != "NONE":
        raise GenerateError(f"'{name}' is bound; Unbind it, fit it, and bind it again")
    if any(found is not None for found in (cage.library, mesh.library, cage.override_library)):
        raise GenerateError(f"'{name}' is linked from another file; fit it in its own file")
    if mesh.users - mesh.use_fake_user > 1:
        raise GenerateError(f"The mesh of '{name}' is shared with another object; make it single-user first")
    if mesh.shape_keys is not None:
        raise GenerateError(f"'{name}' has shape keys, which hold the places of its vertices; remove them first")
    modifier = stack.reshaping(cage)
    if modifier:
        raise GenerateError(f"Modifier '{modifier}' of '{name}' gives it another shape; apply it or hide it, then fit")
    if len(mesh.vertices) > sum(len(skin.data.vertices) for skin in skins):
        raise GenerateError(
            f"'{name}' has more vertices than the skins that it is to enclose; make the rough cage the active object"
        )
    faces = positions.read_faces(mesh)
    large = faces[1] > 4
    if large.any():
        error = GenerateError(
            f"'{name}' has faces of more than four corners, which can be split in many ways; triangulate them"
        )
        error.vertices[cage] = picks.corners_of(faces, large, len(mesh.vertices))
        raise error


def _same(one: _Rough, other: _Rough) -> bool:
    pairs = ((one.points, other.points), *zip(one.faces, other.faces, strict=True), (one.to_rig, other.to_rig))
    return all(np.array_equal(mine, its) for mine, its in pairs)


def _explained(refusal: Refusal, rough: _Rough, scene: refusals.Scene) -> GenerateError:
    """The refusal in the artist's terms."""
    if not refusal.is_of_rough:
        return refusals.explained(refusal, scene)
    text, bone = str(refusal).replace(ROUGH, f"'{rough.cage.name}'", 1), ""
    if refusal.node is not None and scene.armature is not None and scene.graph is not None:
        bone = scene.graph.bone_at(refusal.node)
        text = f"At bone '{bone}' of '{scene.armature.name}': {text}"
    error = GenerateError(text, place=refusal.place)
    error.vertices[rough.cage] = _meant(refusal, rough)
    if bone:
        error.bone = (scene.armature, bone)
    return error


def _meant(refusal: Refusal, rough: _Rough) -> NDArray[np.bool_]:
    """The cage's vertices that a refusal is about: nearest to its place, at its holes, or those that it names."""
    if refusal.place is not None:
        apart = np.linalg.norm(rough.points - refusal.place, axis=1)
        return apart <= apart.min() * (1.0 + 1e-6)
    broken = picks.broken_vertices(rough.points, rough.faces)
    if broken.any():
        return broken
    chosen, faces = np.zeros(len(rough.points), bool), np.zeros(len(rough.faces[1]), bool)
    kinds = {"face": faces, "edge": chosen, "vertex": chosen, "vertices": chosen}
    for kind, *numbers in NAMED.findall(str(refusal)):
        if kind in kinds:
            kinds[kind][[int(number) for number in numbers if number and int(number) < len(kinds[kind])]] = True
    return chosen | picks.corners_of(rough.faces, faces, len(chosen))


def _summary(cage: bpy.types.Object, made: Cage, found: Character) -> str:
    """One sentence on the cage, and what the artist should know."""
    report = made.report
    text = (
        f"'{cage.name}' was fitted: {len(made.points)} vertices, {len(made.faces[1])} faces, "
        f"{report['volume_ratio']:.2f} times the volume of what it encloses, "
        f"with a gap of at least {report['clearance']:.4f} of the character's size"
    )
    return ". ".join([text, *found.notes, *_left_out(made, found)])


def _left_out(made: Cage, found: Character) -> list[str]:
    """A sentence on bones of limbs that the rough cage had nothing around, or none."""
    graph, used = found.scene.graph, np.unique(np.concatenate([arc.nodes for arc in found.generator.arcs]))
    if found.armature is None or graph is None:
        return []
    bones = list(dict.fromkeys(graph.bone_at(node) for node in made.dropped if node in used))
    if not bones:
        return []
    return [f"It had no faces around these bones and was stretched over them: {characters.listed(bones)}"]
