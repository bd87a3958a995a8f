"""Materials of the fixtures, by name: base colour (linear RGB) and roughness."""

from __future__ import annotations

import bpy

PALETTE: dict[str, tuple[tuple[float, float, float], float]] = {
    "Skin": ((0.76, 0.42, 0.28), 0.50),
    "Ink": ((0.018, 0.016, 0.022), 0.25),
    "White": ((0.86, 0.84, 0.80), 0.55),
    "Hoodie": ((0.90, 0.33, 0.06), 0.75),
    "Trim": ((0.72, 0.20, 0.03), 0.80),
    "Trousers": ((0.050, 0.105, 0.20), 0.80),
    "Hat": ((0.035, 0.24, 0.27), 0.80),
    "Shoe": ((0.035, 0.24, 0.27), 0.45),
    "Bar": ((0.035, 0.26, 0.34), 0.45),
    "Octopus": ((0.62, 0.16, 0.20), 0.45),
    "Clay": ((0.62, 0.27, 0.14), 0.60),
    "Bone": ((0.62, 0.66, 0.72), 0.45),
    "Floor": ((0.56, 0.56, 0.56), 1.0),
    "Cage": ((0.08, 0.30, 0.75), 0.40),
}


def material(name: str) -> bpy.types.Material:
    """The material `name`, made on first use (grey if the palette has none of that name)."""
    found = bpy.data.materials.get(name)
    if found is not None:
        return found
    color, roughness = PALETTE.get(name, ((0.5, 0.5, 0.5), 0.6))
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.diffuse_color = (*color, 1.0)
    shader = next(node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Roughness"].default_value = roughness
    return made
