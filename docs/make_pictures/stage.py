"""What the pictures share: characters, areas of the window, panels that are open, and cutting a screenshot."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from types import ModuleType

import bpy
import driver
import numpy as np
from mathutils import Euler

from blend_fixtures.build import RigObjects, build_biped
from blend_fixtures.uncaged import Uncaged

Box = tuple[int, int, int, int]  # left, bottom, right, top in window pixels
CUT = driver.OUT / "cut"
LOOK = 1.0  # seconds until the window shows what was done
GROUND = 0.02  # differences below this are one colour


def start(build: Callable[[], RigObjects] = build_biped, *, bind: bool = True, frame: int = 8) -> RigObjects:
    """A fresh scene with one character, seen from the front; bound where asked for."""
    _clear()
    rig = build()
    bpy.context.scene.frame_end = 48
    bpy.context.scene.frame_set(frame)
    _plain_view()
    driver.look_from_front(rig.skins)
    if bind:
        only(*rig.all, active=rig.cage)
        bpy.ops.cage_rig.bind()
    return rig


def start_with(build: Callable[[], Uncaged]) -> Uncaged:
    """A fresh scene with skins and perhaps their armature, at rest, seen from the front; the sidebar closed."""
    _clear()
    skins, armature = build()
    if armature is not None:
        armature.data.pose_position = "REST"
    bpy.context.view_layer.update()
    _plain_view()
    driver.look_from_front(skins)
    driver.view()[0].spaces.active.show_region_ui = False
    return skins, armature


def _clear() -> None:
    if bpy.context.object is not None and bpy.context.object.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    bpy.data.orphans_purge(do_recursive=True)  # so that names don't count on


def turn(around: float, above: float) -> None:
    """Look from the front, turned by degrees around the character and from above."""
    rotation = Euler((math.radians(90.0 - above), 0.0, math.radians(around))).to_quaternion()
    driver.view()[0].spaces.active.region_3d.view_rotation = rotation


def fit() -> None:
    """What is selected fills the view."""
    area, region = driver.view()
    with bpy.context.temp_override(window=driver.window(), area=area, region=region):
        bpy.ops.view3d.view_selected()


def _plain_view() -> None:
    """No grid, gizmos or 3D cursor."""
    area, _ = driver.view()
    space = area.spaces.active
    space.shading.show_xray = space.show_gizmo_navigate = False
    for name in ("floor", "axis_x", "axis_y", "ortho_grid", "cursor", "text"):
        setattr(space.overlay, f"show_{name}", False)


def only(*objects: bpy.types.Object, active: bpy.types.Object | None = None) -> None:
    """Select these alone, the first or another one active."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = active or objects[0]


def mode(obj: bpy.types.Object, name: str) -> None:
    only(obj)
    bpy.ops.object.mode_set(mode=name)


def hide(*objects: bpy.types.Object) -> None:
    for obj in objects:
        obj.hide_set(True)


def activate(obj: bpy.types.Object) -> None:
    """Active and not selected: its rig's overlays show, and no outline is drawn."""
    only(obj)
    obj.select_set(False)


def points(obj: bpy.types.Object) -> np.ndarray:
    found = np.empty((len(obj.data.vertices), 3), np.float32)
    obj.data.vertices.foreach_get("co", found.ravel())
    return found


def zoom(factor: float, *, centre: tuple[float, float, float] | None = None) -> None:
    """Come nearer by a factor, to a place of the world."""
    area, _ = driver.view()
    view = area.spaces.active.region_3d
    view.view_distance /= factor
    if centre is not None:
        view.view_location = centre


def overlays(*names: str) -> None:
    """These overlays on, all others off."""
    settings = driver.window().workspace.cage_rig_overlays
    for name in ("weights", "joint_weights", "joints", "anchors", "fade"):
        setattr(settings, name, name in names)


def open_panels(*names: str) -> None:
    """The sidebar with these of our sub-panels open (`parts`, `overlays`, `skins`, `bake`, `rig`), the others closed.

    Blender remembers by a panel's identifier whether it is open, and has no function for it: they get new ones.
    """
    panels: ModuleType = sys.modules["bl_ext.user_default.cage_rig"].ui.panels
    for cls in reversed(_shown or [cls for cls in panels.CLASSES if cls.bl_space_type == "VIEW_3D"]):
        bpy.utils.unregister_class(cls)
    _shown.clear()
    _turns.append(0)
    main = f"VIEW3D_PT_cage_rig_{len(_turns)}"
    for cls in (cls for cls in panels.CLASSES if cls.bl_space_type == "VIEW_3D"):
        name = cls.bl_idname.replace("VIEW3D_PT_cage_rig", main)
        fields = {"bl_idname": name, "poll": cls.poll}
        if hasattr(cls, "bl_parent_id"):
            closed = cls.bl_idname.rsplit("_", 1)[1] not in names
            fields |= {"bl_parent_id": main, "bl_options": {"DEFAULT_CLOSED"} if closed else set()}
        _shown.append(type(name, (cls,), fields))
        bpy.utils.register_class(_shown[-1])


_shown: list[type] = []
_turns: list[int] = []


def sidebar() -> Box:
    area, _ = driver.view()
    region = next(region for region in area.regions if region.type == "UI")
    return region.x, region.y, region.x + region.width - 26, region.y + region.height


def view() -> Box:
    """The 3D View between its tools and the sidebar, without the header."""
    area, region = driver.view()
    side = next(other for other in area.regions if other.type == "UI")
    right = side.x if side.width > 1 else region.x + region.width
    return region.x + 50, region.y, right, region.y + region.height - 60


def around(objects: list[bpy.types.Object], margin: int = 30) -> Box:
    """What these objects cover of the 3D View."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    left, bottom, right, top = view()
    places = []
    for obj in objects:
        shown = obj.evaluated_get(depsgraph)
        mesh = obj.data if obj.data.is_editmode else shown.data
        places += [driver.on_screen(shown.matrix_world @ vertex.co) for vertex in mesh.vertices]
    (x0, y0), (x1, y1) = np.min(places, axis=0), np.max(places, axis=0)
    return max(left, x0 - margin), max(bottom, y0 - margin), min(right, x1 + margin), min(top, y1 + margin)


def with_legend(box: Box) -> Box:
    """The box and the corner where the legend is."""
    _, bottom, right, _ = view()
    return joined(box, (right - 200, bottom, right, bottom + 150))


def joined(*boxes: Box) -> Box:
    return (*(min(box[k] for box in boxes) for k in (0, 1)), *(max(box[k] for box in boxes) for k in (2, 3)))


def picture(name: str, box: Box | None = None, *, trim: bool = False, side_by_side: list[str] | None = None) -> None:
    """Save what is seen as `name`, cut to a box; `trim`: without the empty part below.

    `side_by_side`: pictures of the same box that were made before, put to the left of it.
    """
    driver.screenshot(name)
    pixels = _read(name)
    if box is not None:
        pixels = pixels[max(box[1], 0) : box[3], max(box[0], 0) : box[2]]
    if trim:
        full = np.flatnonzero(np.abs(pixels - pixels[:, :1]).max(axis=(1, 2)) > GROUND)
        pixels = pixels[max(int(full[0]) - 8, 0) :]
    parts = [*(_cuts[other] for other in side_by_side or []), pixels]
    gap = np.ones_like(pixels[:, :8])
    _cuts[name] = pixels
    _write(name, np.hstack([piece for part in parts for piece in (part, gap)][:-1]))


_cuts: dict[str, np.ndarray] = {}


def _read(name: str) -> np.ndarray:
    image = bpy.data.images.load(str(driver.OUT / f"{name}.png"))
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[..., :3]


def _write(name: str, pixels: np.ndarray) -> None:
    CUT.mkdir(exist_ok=True)
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height)
    opaque = np.concatenate([pixels, np.ones((height, width, 1), np.float32)], axis=2)
    image.pixels.foreach_set(np.ascontiguousarray(opaque, np.float32).ravel())
    for kind, ending in (("PNG", "png"), ("JPEG", "jpg")):
        image.file_format, image.filepath_raw = kind, str(CUT / f"{name}.{ending}")
        image.save(quality=88)
    bpy.data.images.remove(image)
    driver.check(f"picture {name}", True, f"{width} by {height}")
