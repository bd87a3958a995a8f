"""Reads skinned glTF binaries: welded skins and their skeletons as graphs, for tests and benches."""

import json
import struct
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2] / "addon" / "caging"))
from bones import bone_graph

_TYPES = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def character(path):
    """Vertices, triangles, and the nodes and edges that the add-on makes of the joints with weights."""
    raw = Path(path).read_bytes()
    length = struct.unpack("<I", raw[12:16])[0]
    scene, binary = json.loads(raw[20 : 20 + length]), raw[28 + length :]
    skin, faces, count, used = [], [], 0, set()
    for part in (p for mesh in scene["meshes"] for p in mesh["primitives"]):
        points = _accessor(scene, binary, part["attributes"]["POSITION"]).astype(float)
        index = _accessor(scene, binary, part["indices"]) if "indices" in part else np.arange(len(points))
        faces.append(index.reshape(-1, 3).astype(np.int64) + count)
        joints, weights = (_accessor(scene, binary, part["attributes"][name]) for name in ("JOINTS_0", "WEIGHTS_0"))
        used |= set(joints[weights > 0].tolist())
        skin.append(points)
        count += len(points)
    vertices, place = np.unique(np.concatenate(skin), axis=0, return_inverse=True)
    nodes, edges = _skeleton(scene, binary, sorted(used))
    return vertices, place.ravel()[np.concatenate(faces)], nodes, edges


def _accessor(scene, binary, index):
    accessor = scene["accessors"][index]
    view = scene["bufferViews"][accessor["bufferView"]]
    kind, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride") or kind.itemsize * width
    rows = [np.frombuffer(binary, kind, width, start + row * stride) for row in range(accessor["count"])]
    return np.array(rows)


def _skeleton(scene, binary, used):
    """glTF has joints alone. Blender's importer leads bones along their y axis, as far as the nearest child, or as far
    as their parent.
    """
    skin = scene["skins"][0]
    rest = np.linalg.inv(_accessor(scene, binary, skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1))
    heads = rest[:, :3, 3].astype(float)
    row = {joint: i for i, joint in enumerate(skin["joints"])}
    parents = np.full(len(row), -1, np.int32)
    for joint, i in row.items():
        parents[[row[child] for child in scene["nodes"][joint].get("children", []) if child in row]] = i
    reach = np.linalg.norm(heads - heads[parents], axis=1)
    lengths = [min((d for d in reach[parents == i] if d > 0), default=reach[i]) for i in range(len(row))]
    along = rest[:, :3, 1] / np.linalg.norm(rest[:, :3, 1], axis=1, keepdims=True)
    names = [str(i) for i in range(len(row))]
    graph = bone_graph(names, parents, heads, heads + along * np.array(lengths)[:, None], used)
    return graph.nodes, graph.edges
