"""A photo studio in a scene of its own: soft light, an endless white floor, an orthographic camera, Cycles on the CPU.

A panel is measured in units; 100 pixels a unit at full size. Its middle is the origin of the picture plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

from blend_fixtures.materials import PALETTE, material

Array = np.ndarray

TILT = np.radians(9.0)
PIXELS_PER_UNIT = 100
SUNS = (  # direction, strength in W/m², angle in radians
    ((0.55, 0.85, -1.15), 2.5, 0.35),
    ((-0.9, 0.15, -0.55), 0.7, 0.6),
    ((-0.2, -1.0, -0.45), 1.0, 0.5),
)
SKY, SKY_STRENGTH = (0.88, 0.93, 1.0), 0.62
INK = (0.035, 0.045, 0.065)


@dataclass(frozen=True)
class Quality:
    """How a panel is rendered.

    `scale`: of the full size; `samples`: paths a pixel; `guided`: denoise by colours and normals too, which keeps
    small text legible and the grain of what is seen through a film.
    """

    scale: float = 1.0
    samples: int = 8
    guided: bool = False


QUICK = Quality(scale=0.5, samples=5, guided=True)


class Studio:
    """A scene for one panel of `width` by `height` units."""

    def __init__(self, name: str, *, width: float, height: float) -> None:
        self.scene = bpy.data.scenes.new(name)
        self.width, self.height = width, height
        self._light()
        self._camera()

    def add_mesh(self, mesh: bpy.types.Mesh, *, matrix: Matrix | None = None, shadow: bool = True) -> bpy.types.Object:
        """Place `mesh`; without `shadow` it casts none (lines, labels)."""
        made = bpy.data.objects.new(mesh.name, mesh)
        made.matrix_world = matrix or Matrix()
        made.visible_shadow = shadow
        self.scene.collection.objects.link(made)
        return made

    def add_floor(self, *, height: float) -> None:
        """An even floor at z = `height` that fills the picture; `render` scales its brightness to 1."""
        mesh = bpy.data.meshes.new("Floor")
        far = 400.0
        mesh.from_pydata(
            [(-far, -far, height), (far, -far, height), (far, far, height), (-far, far, height)], [], [(0, 1, 2, 3)]
        )
        mesh.materials.append(material("Floor"))
        self.add_mesh(mesh)

    def add_label(
        self, text: str, *, x: float, y: float, size: float, color: tuple[float, ...] = INK, align: str = "CENTER"
    ) -> None:
        """Text on the picture plane at (x, y) units from the middle."""
        curve = bpy.data.curves.new("Label", "FONT")
        curve.body, curve.size, curve.align_x, curve.align_y = text, size, align, "CENTER"
        curve.materials.append(flat_material(f"Label {color}", color))
        made = bpy.data.objects.new("Label", curve)
        made.matrix_world = (
            Matrix.Translation(self.on_plane(x, y, depth=20.0)) @ Euler((np.pi / 2 - TILT, 0, 0)).to_matrix().to_4x4()
        )
        made.visible_shadow = made.visible_diffuse = made.visible_glossy = False
        self.scene.collection.objects.link(made)

    def on_plane(self, x: float, y: float, *, depth: float = 0.0) -> Vector:
        """The point that is seen at (x, y), `depth` units toward the camera from the picture plane."""
        return Vector((x, 0.0, 0.0)) + y * Vector((0.0, np.sin(TILT), np.cos(TILT))) - depth * view_direction()

    def render(self, path: Path, quality: Quality) -> Array:
        """Render by way of `path`; returns display values over a floor of 1 (height by width by 3, top row first)."""
        scene = self.scene
        self.set_up(quality)
        scene.render.image_settings.file_format = "PNG"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True, scene=scene.name)
        image = bpy.data.images.load(str(path))
        pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
        image.pixels.foreach_get(pixels)
        shape = (image.size[1], image.size[0], 4)
        bpy.data.images.remove(image)
        path.unlink()
        colors = pixels.reshape(shape)[::-1, :, :3]
        corner = colors[:4, : max(4, colors.shape[1] // 32)]
        return np.minimum(colors / np.median(corner, axis=(0, 1)), 1.0)

    def set_up(self, quality: Quality) -> None:
        """Choose how the scene is rendered."""
        _cycles(self.scene, quality)
        self.scene.render.resolution_x = round(self.width * PIXELS_PER_UNIT * quality.scale)
        self.scene.render.resolution_y = round(self.height * PIXELS_PER_UNIT * quality.scale)

    def whiten_floor(self) -> None:
        """Let the floor come out white, for renders that `render` does not scale."""
        view = self.scene.view_settings
        view.use_curve_mapping = True
        view.curve_mapping.white_level = _floor_light()
        view.curve_mapping.update()

    def _camera(self) -> None:
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        camera.data.type, camera.data.ortho_scale = "ORTHO", max(self.width, self.height)
        camera.data.clip_end = 200.0
        camera.location = -60.0 * view_direction()
        camera.rotation_euler = (np.pi / 2 - TILT, 0.0, 0.0)
        self.scene.collection.objects.link(camera)
        self.scene.camera = camera

    def _light(self) -> None:
        for direction, strength, angle in SUNS:
            lamp = bpy.data.lights.new("Sun", "SUN")
            lamp.energy, lamp.angle = strength, angle
            made = bpy.data.objects.new("Sun", lamp)
            made.rotation_euler = Vector(direction).to_track_quat("-Z", "Y").to_euler()
            self.scene.collection.objects.link(made)
        world = bpy.data.worlds.new("Studio")
        if world.node_tree is None:
            world.use_nodes = True
        background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
        background.inputs["Color"].default_value = (*SKY, 1.0)
        background.inputs["Strength"].default_value = SKY_STRENGTH
        self.scene.world = world


def view_direction() -> Vector:
    """Unit vector from the camera into the picture."""
    return Vector((0.0, np.cos(TILT), -np.sin(TILT)))


def flat_material(name: str, color: tuple[float, ...], *, strength: float = 1.0) -> bpy.types.Material:
    """A material of one colour, not shaded by light."""
    made = bpy.data.materials.get(name)
    if made is None:
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        nodes, links = made.node_tree.nodes, made.node_tree.links
        nodes.clear()
        emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
        emission.inputs["Color"].default_value = (*color, 1.0)
        emission.inputs["Strength"].default_value = strength
        links.new(emission.outputs[0], output.inputs["Surface"])
    return made


def glass_material(name: str, color: tuple[float, ...], *, opacity: float) -> bpy.types.Material:
    """A thin translucent film. Added rather than mixed: a mix is a choice by chance at every hit, which is noise."""
    made = bpy.data.materials.get(name)
    if made is None:
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        nodes, links = made.node_tree.nodes, made.node_tree.links
        nodes.clear()
        clear, film = nodes.new("ShaderNodeBsdfTransparent"), nodes.new("ShaderNodeEmission")
        both, output = nodes.new("ShaderNodeAddShader"), nodes.new("ShaderNodeOutputMaterial")
        clear.inputs["Color"].default_value = (*[1.0 - opacity] * 3, 1.0)
        film.inputs["Color"].default_value = (*color, 1.0)
        film.inputs["Strength"].default_value = opacity
        links.new(clear.outputs[0], both.inputs[0])
        links.new(film.outputs[0], both.inputs[1])
        links.new(both.outputs[0], output.inputs["Surface"])
    return made


def attribute_material(name: str, *, roughness: float) -> bpy.types.Material:
    """A material whose colour is the mesh's colour attribute `name`."""
    made = material(name)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].default_value = roughness
    source = nodes.new("ShaderNodeAttribute")
    source.attribute_name = name
    links.new(source.outputs["Color"], shader.inputs["Base Color"])
    return made


def _floor_light() -> tuple[float, float, float]:
    """The light that comes from the empty floor (linear RGB)."""
    suns = sum(strength * Vector(direction).normalized().z for direction, strength, _ in SUNS)
    albedo = PALETTE["Floor"][0]
    return tuple(a * (SKY_STRENGTH * sky - suns / np.pi) for a, sky in zip(albedo, SKY, strict=True))


def _cycles(scene: bpy.types.Scene, quality: Quality) -> None:
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = quality.samples
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.adaptive_threshold = 0.05
    scene.cycles.use_denoising = True
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL" if quality.guided else "RGB"
    scene.cycles.denoising_prefilter = "FAST"
    scene.cycles.max_bounces = 2
    scene.cycles.diffuse_bounces = 1
    scene.cycles.glossy_bounces = 1
    scene.cycles.transparent_max_bounces = 12
    scene.render.image_settings.color_mode = "RGB"
    scene.view_settings.view_transform = "Standard"
