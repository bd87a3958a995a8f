# SPDX-License-Identifier: GPL-3.0-or-later
"""Cages generated from a character and its bones.

    from bl_ext.user_default.cage_rig import caging
    objects = bpy.data.objects
    cage = caging.generate_cage(bpy.context, [objects["Body"]], objects["Armature"])

The object that comes back is a closed mesh around the skins at rest, ready for `lifecycle.bind`. It keeps how it was
made in `cage.cage_rig_generated`, and for each vertex the cross section (attribute `cage_rig_section`) and the bone
(vertex groups) that it belongs to. Where no cage can be made, `GenerateError` says why, and nothing has changed.
`fit_cage` moves the vertices of a cage that somebody made so that it encloses the skins.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..generator import Cancelled, Job, Refusal
from . import alike, character, refusals, result
from .alike import cages, corners_of, suggested
from .character import Character
from .course import OnBone
from .editing import Editing, Source
from .fitting import Fitting, fit_cage
from .options import Options
from .refusals import GenerateError
from .result import SECTION, like_of, nodes_of, options_of, refuse_cage

__all__ = [
    "SECTION",
    "Cancelled",
    "Character",
    "Editing",
    "Fitting",
    "GenerateError",
    "Job",
    "OnBone",
    "Options",
    "Source",
    "cages",
    "corners_of",
    "edit",
    "finish",
    "fit_cage",
    "generate_cage",
    "like_of",
    "make",
    "nodes_of",
    "open_character",
    "options_of",
    "refuse_cage",
    "source",
    "start",
    "suggested",
]


def generate_cage(
    context: bpy.types.Context,
    skins: list[bpy.types.Object],
    armature: bpy.types.Object | None,
    options: Options | None = None,
    *,
    nodes: list[OnBone] | None = None,
    cage: bpy.types.Object | None = None,
    like: bpy.types.Object | None = None,
    tell: Callable[[str], object] | None = None,
    watch: Callable[[Job], object] | None = None,
) -> bpy.types.Object:
    """Generate a cage around skins, from the bones of their armature that move them. Object Mode.

    Without an armature (None) the core looks for a skeleton in the skin.

    `nodes`: bending nodes as (bone, position), 0 at the bone's head and 1 at its tail; else they are placed. `cage`: an
    object that gets the new mesh in place of its own, with the nodes that it remembers unless others are given. `like`:
    a generated cage whose cross sections and faces, index for index, the new one gets. `tell` gets a sentence on what
    was made, `watch` the job twice a second while it works.
    """
    if cage is not None:
        options = options or options_of(cage)
        nodes = nodes_of(cage) if nodes is None else nodes
        like = like or like_of(cage)
    options = options or (Options() if like is None else Options(corners=corners_of(like)))
    return make(context, skins, armature, options, nodes, cage=cage, like=like, tell=tell, watch=watch)


def make(
    context: bpy.types.Context,
    skins: list[bpy.types.Object],
    armature: bpy.types.Object | None,
    options: Options,
    nodes: list[OnBone] | None,
    *,
    cage: bpy.types.Object | None,
    like: bpy.types.Object | None = None,
    tell: Callable[[str], object] | None,
    watch: Callable[[Job], object] | None = None,
) -> bpy.types.Object:
    """As `generate_cage`, but nothing is taken from the cage."""
    if cage is not None:
        refuse_cage(cage, like)
    found = open_character(context, armature, skins, options, like)
    editing = edit(found, options, nodes)
    try:
        job = start(found, options, editing, cage)
        while not job.wait(0.1):
            if watch is not None:
                watch(job)
        return finish(context, job, found, options, editing.nodes, cage=cage, tell=tell)
    except Refusal as refusal:
        raise explain(refusal, found) from refusal


def start(found: Character, options: Options, editing: Editing, cage: bpy.types.Object | None) -> Job:
    """Begin to make the cage of these nodes. Sections of `cage` that they leave alone stay as they are."""
    earlier = result.earlier(cage, found, options) if cage else None
    return found.generator.start(editing.bending, earlier, found.model and found.model.like)


def open_character(
    context: bpy.types.Context,
    armature: bpy.types.Object | None,
    skins: list[bpy.types.Object],
    options: Options,
    like: bpy.types.Object | None = None,
) -> Character:
    """Read a character, to be caged like another one or not. Raises `GenerateError`."""
    return character.read(context, armature, skins, options, like)


def edit(found: Character, options: Options, nodes: list[OnBone] | None) -> Editing:
    """The character's bending nodes, to be edited. Raises `GenerateError`."""
    try:
        if nodes is None and found.model is not None:
            sections = found.generator.sections(None, found.model.like)
            nodes = [found.course.named(found.course.nearest(section.place)) for section in sections if section.bending]
        return Editing(source(found, options), symmetry=options.symmetry, nodes=nodes)
    except Refusal as refusal:
        raise explain(refusal, found) from refusal


def source(found: Character, options: Options) -> Source:
    """What places the nodes of a character."""
    return Source(found.generator, found.course, options.placement)


def finish(
    context: bpy.types.Context,
    job: Job,
    found: Character,
    options: Options,
    nodes: list[OnBone] | None,
    *,
    cage: bpy.types.Object | None = None,
    tell: Callable[[str], object] | None = None,
) -> bpy.types.Object:
    """The object of a cage that is done. Raises `Refusal` or `Cancelled`."""
    made = job.result()
    obj = result.write(context, cage, made, found, options, nodes)
    if tell is not None:
        others = [] if found.model is not None else suggested(context.scene, obj)[:1]
        hints = [f"To give it the faces of '{other.name}', choose that cage in Like" for other in others]
        tell(result.summary(obj, made, [*found.notes, *character.left_out(found, made.dropped), *hints]))
    return obj


def explain(refusal: Refusal, found: Character) -> GenerateError:
    """A refusal of the core in the artist's terms."""
    if found.model is not None and not refusal.is_of_skin:
        return alike.explained(refusal, found.model, found.scene)
    return refusals.explained(refusal, found.scene)
