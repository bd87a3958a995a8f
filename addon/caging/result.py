# SPDX-License-Identifier: GPL-3.0-or-later
"""The generated cage as an object, ready to be bound, which remembers how it was made."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import bpy
import numpy as np
from mathutils import Matrix

from ..adapters import positions, vertex_groups
from ..generator import Cage, Earlier, Points
from .alike import SECTION, is_generated, same_faces, sections_of
from .character import Character
from .course import OnBone
from .options import Options
from .refusals import GenerateError


def refuse_cage(cage: bpy.types.Object, like: bpy.types.Object | None = None) -> None:
    """Raise `GenerateError` where this object can't get a new cage in place of its own."""
    if cage == like != like_of(cage):
        raise GenerateError(f"'{cage.name}' can't be like itself; choose another cage for Like, or none")
    if cage.cage_rig.state != "NONE":
        raise GenerateError(f"'{cage.name}' is bound; Unbind it, generate it anew, and bind it again")
    if cage.library is not None or cage.data.library is not None or cage.override_library is not None:
        raise GenerateError(f"'{cage.name}' is linked from another file; generate it in its own file")
    if cage.data.shape_keys is not None:
        raise GenerateError(f"'{cage.name}' has shape keys, which a new cage has no vertices for; remove them first")


def write(
    context: bpy.types.Context,
    cage: bpy.types.Object | None,
    made: Cage,
    character: Character,
    options: Options,
    nodes: list[OnBone] | None,
) -> bpy.types.Object:
    """Make the object, or give `cage` a new mesh in place of its own. Object Mode. Selects what Bind needs."""
    corners, sizes = (part.astype(np.int32) for part in made.faces)
    placed, correction = _placed(character.space)
    points = positions.apply_matrix(correction, made.points)
    if cage is None:
        mesh = positions.new_mesh(f"{_name(character)} Cage", points, (corners, sizes))
        cage = bpy.data.objects.new(mesh.name, mesh)
        cage.display_type, cage.hide_render = "WIRE", True
        homes = character.skins[0].users_collection or (context.scene.collection,)
        homes[0].objects.link(cage)
    else:
        cage.data.clear_geometry()
        cage.vertex_groups.clear()
        positions.fill(cage.data, points, (corners, sizes))
    cage.matrix_world = placed
    owners = cage.data.attributes.new(SECTION, "INT", "POINT")
    owners.data.foreach_set("value", made.owners.astype(np.int32))
    bones = _bones(made, character)
    if character.armature is not None:
        vertex_groups.write_whole(cage, [bones[owner] for owner in made.owners.tolist()])
    _remember(cage, character, options, nodes)
    arrangement = made.report["arrangement"]
    cage.cage_rig_generated.arrangement = "" if arrangement is None else " ".join(map(str, arrangement))
    cage.cage_rig_generated.fingerprint = character.generator.given.fingerprint
    select(context, cage, character)
    return cage


def _placed(space: bpy.types.Object) -> tuple[Matrix, Points]:
    """Where the cage object is put, and what brings rig space to its own: more than nothing where rig space is sheared,
    by parents of unequal scales, as no object without parents can be.
    """
    world = space.matrix_world
    placed = Matrix.LocRotScale(*world.decompose())
    left = np.linalg.inv(np.array(placed)) @ np.array(world)
    return placed, np.eye(4) if np.abs(left - np.eye(4)).max() < 1e-6 else left


def _name(character: Character) -> str:
    return character.skins[0].name if len(character.skins) == 1 else character.space.name


def _bones(made: Cage, character: Character) -> list[str]:
    """The bone of each section."""
    course = character.course
    places = [course.nearest(section.point) for section in made.sections]
    return [course.named(place).bone for place in places]


def _remember(cage: bpy.types.Object, character: Character, options: Options, nodes: list[OnBone] | None) -> None:
    kept = cage.cage_rig_generated
    kept.armature = character.armature
    kept.skins.clear()
    for skin in character.skins:
        kept.skins.add().object = skin
    for name, value in vars(options).items():
        setattr(kept, name, value)
    if character.model is None:
        kept.like = ""
    elif character.model.cage != cage:
        kept.like = character.model.cage.name
    kept.own_nodes = nodes is not None
    kept.nodes.clear()
    for node in nodes or ():
        item = kept.nodes.add()
        item.name, item.position = node


def select(context: bpy.types.Context, cage: bpy.types.Object, character: Character) -> None:
    """Select what Bind needs, the cage active."""
    chosen = (*character.skins, character.armature, cage)
    for obj in context.view_layer.objects:
        obj.select_set(obj in chosen)
    if cage.name in context.view_layer.objects:
        context.view_layer.objects.active = cage


def options_of(cage: bpy.types.Object) -> Options:
    """How this cage was generated."""
    kept = cage.cage_rig_generated
    return Options(**{name: getattr(kept, name) for name in vars(Options())})


def nodes_of(cage: bpy.types.Object) -> list[OnBone] | None:
    """The artist's bending nodes of this cage; None where they were placed."""
    kept = cage.cage_rig_generated
    return [OnBone(node.name, node.position) for node in kept.nodes] if kept.own_nodes else None


def like_of(cage: bpy.types.Object) -> bpy.types.Object | None:
    """The cage that this one is like; None where it has faces of its own.

    A name is remembered, so that the other character does not come along where this one is appended. Where it is
    renamed, or in another file, a cage with the same faces stands in, and at last this one, which has them.
    """
    name = cage.cage_rig_generated.like
    if not name:
        return None
    other = bpy.data.objects.get(name)
    if other is not None and other.users_scene and is_generated(other):
        return other
    others = (obj for obj in bpy.data.objects if obj != cage and obj.users_scene and is_generated(obj))
    return next((obj for obj in others if same_faces(cage, obj)), cage)


def earlier(cage: bpy.types.Object, character: Character, options: Options) -> Earlier | None:
    """What this cage can lend to one with other nodes: nothing where more than nodes has changed since it was made."""
    before, nodes = options_of(cage), nodes_of(cage)
    if nodes is not None:
        before = replace(before, placement=options.placement)  # nothing was placed
    kept, owners = cage.cage_rig_generated, sections_of(cage)
    known = kept.fingerprint == character.generator.given.fingerprint
    known &= character.model is None or character.model.cage == like_of(cage)
    if not known or before.core() != options.core() or owners is None:
        return None
    if not np.array_equal(owners, np.repeat(np.arange(len(owners) // options.corners), options.corners)):
        return None  # the artist has added or deleted vertices
    to_rig = np.linalg.inv(np.array(character.space.matrix_world)) @ np.array(cage.matrix_world)
    points = positions.apply_matrix(to_rig, positions.read_base(cage.data).astype(float))
    course = character.course
    bending = None if nodes is None else course.points(course.places(nodes))
    arrangement = [int(arc) for arc in kept.arrangement.split()] or None
    return Earlier(bending, points, positions.read_faces(cage.data), arrangement)


def summary(cage: bpy.types.Object, made: Cage, notes: list[str]) -> str:
    """One sentence on the cage, and what the artist should know."""
    sizes = Counter(made.faces[1].tolist())
    quads, triangles = sum(sizes.values()) - sizes[3], sizes[3]
    text = (
        f"'{cage.name}': {len(made.points)} vertices in {len(made.sections)} cross sections, {quads} quads and "
        f"{triangles} triangles, {made.report['volume_ratio']:.2f} times the volume of what it encloses"
    )
    other = like_of(cage)
    if other not in (None, cage) and same_faces(cage, other):
        text += f", with the faces of '{other.name}'"
    if made.report["kept_vertices"]:
        text += f"; {made.report['kept_vertices']} vertices are where they were"
    return ". ".join([text, *notes])
