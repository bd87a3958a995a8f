"""Reads skinned glTF binaries: welded skins and their skeletons as graphs, for tests and benches."""

import json
import struct
from pathlib import Path

import numpy as np

_TYPES = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def character(path):
    """Vertices, triangles, nodes and edges. glTF knows no tails: the last joint of a limb gets one straight ahead."""
    raw = Path(path).read_bytes()
    length = struct.unpack("<I", raw[12:16])[0]
    scene, binary = json.loads(raw[20 : 20 + length]), raw[28 + length :]
    skin, faces, count = [], [], 0
    for part in (p for mesh in scene["meshes"] for p in mesh["primitives"]):
        points = _accessor(scene, binary, part["attributes"]["POSITION"]).astype(float)
        index = _accessor(scene, binary, part["indices"]) if "indices" in part else np.arange(len(points))
        faces.append(index.reshape(-1, 3).astype(np.int64) + count)
        skin.append(points)
        count += len(points)
    vertices, place = np.unique(np.concatenate(skin), axis=0, return_inverse=True)
    nodes, edges = _skeleton(scene, binary)
    return vertices, place.ravel()[np.concatenate(faces)], nodes, edges


def _accessor(scene, binary, index):
    accessor = scene["accessors"][index]
    view = scene["bufferViews"][accessor["bufferView"]]
    kind, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride") or kind.itemsize * width
    rows = [np.frombuffer(binary, kind, width, start + row * stride) for row in range(accessor["count"])]
    return np.array(rows)


def _skeleton(scene, binary):
    skin = scene["skins"][0]
    inverse = _accessor(scene, binary, skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    nodes = [np.linalg.inv(matrix.astype(float))[:3, 3] for matrix in inverse]
    row = {joint: i for i, joint in enumerate(skin["joints"])}
    edges = [
        (row[joint], row[child])
        for joint in skin["joints"]
        for child in scene["nodes"][joint].get("children", [])
        if child in row
    ]
    parents = {a for a, _ in edges}
    for a, b in [edge for edge in edges if edge[1] not in parents]:
        edges.append((b, len(nodes)))
        nodes.append(nodes[b] + 0.6 * (nodes[b] - nodes[a]))
    return np.array(nodes), np.array(edges)
