# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of a skin in the colours of its errors, by Cycles, which needs no window and no graphics card."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..adapters import positions

SIDE = 800
# Grey up to the tolerance, then from blue over orange to red; a hundred times the tolerance is all red.
COLOURS = np.array([[0.35, 0.35, 0.35], [0.1, 0.25, 0.8], [1.0, 0.45, 0.05], [0.8, 0.0, 0.0]])
DECADES = 2.0


def draw(skin: bpy.types.Object, errors: NDArray[np.float64], frame: int, tolerance: float, path: Path) -> None:
    """Draw `skin` as it stands at `frame`, `errors` (#M, relative) in colours, seen from its front."""
    bpy.context.scene.frame_set(frame)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(skin.evaluated_get(depsgraph))
    scene = bpy.data.scenes.new("Cage Rig Comparison")
    try:
        if len(mesh.vertices) != len(errors):  # modifiers after ours make others: show what ours has placed
            bpy.data.meshes.remove(mesh)
            mesh = skin.data.copy()
        obj = bpy.data.objects.new("Errors", mesh)
        obj.matrix_world = skin.matrix_world
        scene.collection.objects.link(obj)
        _paint(mesh, _colours(errors, tolerance))
        _place_camera(scene, obj)
        _light(scene)
        render = scene.render
        render.engine, render.resolution_x, render.resolution_y = "CYCLES", SIDE, SIDE
        scene.cycles.samples, scene.cycles.device, scene.cycles.use_denoising = 16, "CPU", False
        scene.view_settings.view_transform = "Standard"
        render.image_settings.file_format, render.filepath = "PNG", str(path)
        bpy.ops.render.render(write_still=True, scene=scene.name)
    finally:
        for found in list(scene.collection.objects):
            data = found.data
            bpy.data.objects.remove(found)
            bpy.data.batch_remove([data])
        if scene.world is not None:
            bpy.data.worlds.remove(scene.world)
        bpy.data.scenes.remove(scene)


def _colours(errors: NDArray[np.float64], tolerance: float) -> NDArray[np.float32]:
    """`#M by 4`."""
    least = max(tolerance, 1e-12)
    place = np.clip(np.log10(np.maximum(errors, 1e-30) / least) / DECADES, 0.0, 1.0) * (len(COLOURS) - 2) + 1.0
    place[errors <= least] = 0.0
    found = [np.interp(place, range(len(COLOURS)), channel) for channel in COLOURS.T]
    return np.stack([*found, np.ones_like(place)], axis=1).astype(np.float32)


def _paint(mesh: bpy.types.Mesh, colours: NDArray[np.float32]) -> None:
    layer = mesh.attributes.new("cage_rig_errors", "FLOAT_COLOR", "POINT")
    layer.data.foreach_set("color", colours.ravel())
    material = bpy.data.materials.new("Cage Rig Errors")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    source = nodes.new("ShaderNodeVertexColor")
    source.layer_name = layer.name
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].default_value = 0.8
    material.node_tree.links.new(source.outputs["Color"], shader.inputs["Base Color"])
    mesh.materials.clear()
    mesh.materials.append(material)


def _place_camera(scene: bpy.types.Scene, obj: bpy.types.Object) -> None:
    points = positions.apply_matrix(np.array(obj.matrix_world), positions.read_base(obj.data))
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.linalg.norm(high - low))
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale, camera.clip_end = "ORTHO", 1.02 * size, 10.0 * size + 1.0
    seen = bpy.data.objects.new("Camera", camera)
    away = Vector((0.45, -1.0, 0.3)).normalized()
    seen.location = Vector(((low + high) / 2.0).tolist()) + away * 3.0 * size
    seen.rotation_euler = away.to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(seen)
    scene.camera = seen


def _light(scene: bpy.types.Scene) -> None:
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 2.0, (0.7, 0.2, 0.5)
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("Cage Rig Comparison")
    scene.world.color = (0.6, 0.6, 0.6)
