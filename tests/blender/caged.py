"""What a generated cage must be, looked at from outside the generator; and every character that there is one for."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import cage_rig_core as core
import exact
import numpy as np
from scene import select, update

from blend_fixtures import rigs
from blend_fixtures.arm import arm
from blend_fixtures.bar import bar
from blend_fixtures.biped import biped
from blend_fixtures.octopus import octopus
from blend_fixtures.small import capsule, simple_bar, two_roots, two_skins
from blend_fixtures.uncaged import Uncaged, built, without_cage

FIXTURES = (arm, bar, biped, octopus, capsule, simple_bar, two_roots, two_skins)


def rigged(name: str) -> Callable[[], Uncaged]:
    return without_cage(lambda: rigs.build_rig(name))


def every_fixture() -> dict[str, Callable[[], Uncaged]]:
    found = {make.__name__: built(make) for make in FIXTURES}
    return found | {name: rigged(name) for name in rigs.RIGS}


def inside_of(space: np.ndarray, obj: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """Base points as `space`, a matrix to the world, has them, and triangles."""
    mesh = obj.data
    points = np.empty((len(mesh.vertices), 3))
    mesh.vertices.foreach_get("co", np.ravel(points))
    matrix = np.linalg.inv(space) @ np.array(obj.matrix_world)
    mesh.calc_loop_triangles()
    triangles = np.empty((len(mesh.loop_triangles), 3), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles.ravel())
    return points @ matrix[:3, :3].T + matrix[:3, 3], triangles.astype(int)


def deforming(obj: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """Base points and the triangles that a bind cuts the faces into."""
    mesh = obj.data
    points = np.empty((len(mesh.vertices), 3))
    mesh.vertices.foreach_get("co", np.ravel(points))
    corners, sizes = np.empty(len(mesh.loops), np.int32), np.empty(len(mesh.polygons), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.polygons.foreach_get("loop_total", sizes)
    return points, core.check_cage(points, (corners, sizes))["triangles"]


def skin_of(skins: list[bpy.types.Object], armature: bpy.types.Object | None) -> tuple[np.ndarray, np.ndarray]:
    """All of the skins at rest, in rig space."""
    if armature is not None:
        armature.data.pose_position = "REST"
    update()
    space = np.array((armature or skins[0]).matrix_world)
    parts = [inside_of(space, skin) for skin in skins]
    starts = np.cumsum([0] + [len(points) for points, _ in parts])
    points = np.concatenate([points for points, _ in parts])
    return points, np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)])


def parts_of(count: int, faces: np.ndarray) -> np.ndarray:
    """A vertex of each connected part."""
    label = np.arange(count)
    while True:
        least = label[faces].min(1)
        before = label.copy()
        for k in range(3):
            np.minimum.at(label, faces[:, k], least)
        label = label[label]
        if np.array_equal(label, before):
            return np.unique(label[faces])


def angles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    corners = points[triangles]
    sides = corners[:, [1, 2, 0]] - corners
    sides /= np.linalg.norm(sides, axis=2, keepdims=True)
    return np.degrees(np.arccos(np.clip(-(sides * sides[:, [2, 0, 1]]).sum(2), -1, 1)))


def measure(
    cage: bpy.types.Object, skins: list[bpy.types.Object], armature: bpy.types.Object | None
) -> dict[str, object]:
    """All numbers of one cage, in rig space."""
    skin, skin_faces = skin_of(skins, armature)
    points, triangles = inside_of(np.array((armature or skins[0]).matrix_world), cage)
    size = float(np.linalg.norm(np.ptp(skin, axis=0)))
    sections = np.empty(len(points), np.int32)
    cage.data.attributes["cage_rig_section"].data.foreach_get("value", sections)
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    directed = set(map(tuple, edges.tolist()))
    closed = len(directed) == len(edges) and directed == {(b, a) for a, b in directed}
    genus = 1 - (len(points) - len(edges) // 2 + len(triangles)) / 2
    places = np.concatenate([parts_of(len(skin), skin_faces), np.arange(0, len(skin), len(skin) // 1000 + 1)])
    image = points * [-1, 1, 1] + [points[:, 0].min() + points[:, 0].max(), 0, 0]
    apart = [np.linalg.norm(points - place, axis=1).min() for place in image]
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return {
        "vertices": len(points),
        "triangles": len(triangles),
        "sections": int(sections.max()) + 1,
        "counts": bool(
            len(points) == 4 * (sections.max() + 1)
            and (np.bincount(sections) == 4).all()
            and len(triangles) == 2 * len(points) - 4 + 4 * genus
        ),
        "genus": int(genus),
        "closed": closed and float(np.einsum("ij,ij->", a, np.cross(b, c))) > 0,
        "outside": int((np.abs(exact.winding(skin[places], points, triangles) - 1) > 1e-6).sum()),
        "meeting": len(exact.meeting(points, triangles, skin, skin_faces)),
        "self": len(exact.self_meeting(points, triangles)),
        "clearance": exact.nearer(points, triangles, skin, skin_faces, 2e-3 * size) / size,
        "mirror": max(apart) / size,
        "middle": float(abs(points[:, 0].min() + points[:, 0].max() - skin[:, 0].min() - skin[:, 0].max())) / 2 / size,
        "angle": float(angles(*deforming(cage)).min()),
        "angle_shown": float(angles(points, triangles).min()),
        "coordinates": float(core.mean_value_coordinates(skin[places], points, triangles).min()),
    }


def is_symmetric(skins: list[bpy.types.Object], armature: bpy.types.Object | None) -> bool:
    """Whether skins and bones are their own mirror images in x."""
    skin, _ = skin_of(skins, armature)
    middle = [0.5 * (skin[:, 0].min() + skin[:, 0].max()), 0, 0]
    size = float(np.linalg.norm(np.ptp(skin, axis=0)))
    bones = [] if armature is None else [bone for bone in armature.data.bones if bone.use_deform]
    ends = np.array([end for bone in bones for end in (bone.head_local, bone.tail_local)]).reshape(-1, 3)
    return _mirrored((skin - middle) / size, 1e-5) and _mirrored((ends - middle) / size, 0.01)


def _mirrored(points: np.ndarray, near: float) -> bool:
    cell = np.round(points / near).astype(np.int64)
    known = {tuple(row) for row in cell.tolist()}
    steps = [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)]
    some = cell[:: len(cell) // 400 + 1].tolist()
    return all(any((-x + i, y + j, z + k) in known for i, j, k in steps) for x, y, z in some)


def faults(found: dict[str, object], *, symmetric: bool) -> list[str]:
    """What is wrong with a cage, by name."""
    wrong = [name for name in ("outside", "meeting", "self") if found[name]]
    wrong += [name for name in ("closed", "counts") if not found[name]]
    limits = {"clearance": 1e-4, "angle": 5.0, "coordinates": -0.3}
    wrong += [name for name, least in limits.items() if found[name] < least]
    if symmetric and max(found["mirror"], found["middle"]) > 1e-6:
        wrong.append("mirror")
    return wrong


def choose(skins: list[bpy.types.Object], armature: bpy.types.Object | None) -> None:
    """Select what Generate Cage needs."""
    chosen = [*skins] if armature is None else [*skins, armature]
    select(chosen, chosen[-1])
