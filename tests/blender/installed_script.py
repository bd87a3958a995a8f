"""One life of the extension in one process: installed, used, disabled, removed, installed again. Run by test_installed.

Prints a line for everything that it finds wrong, and "DONE" at the end.
"""

from __future__ import annotations

import sys
from pathlib import Path

import extension

extension.isolate()

import bpy  # noqa: E402, I001  (after the user folder is set, and before its own modules)
import addon_utils  # noqa: E402

HANDLERS = [name for name in dir(bpy.app.handlers) if isinstance(getattr(bpy.app.handlers, name), list)]
MENUS = [name for name in dir(bpy.types) if "_MT_" in name or "_PT_" in name]


def left_behind() -> dict[str, object]:
    """Everything of an add-on that Blender may keep, as it is now."""
    draws = {name: getattr(getattr(bpy.types, name).draw, "_draw_funcs", []) for name in MENUS}
    return {
        "handlers": [name for name in HANDLERS if _ours(getattr(bpy.app.handlers, name))],
        "classes": sorted(name for name in dir(bpy.types) if "cage_rig" in name.lower()),
        "properties": sorted(
            f"{kind.__name__}.{name}"
            for kind in (bpy.types.Object, bpy.types.WorkSpace, bpy.types.Scene, bpy.types.WindowManager)
            for name in [prop.identifier for prop in kind.bl_rna.properties]
            if "cage_rig" in name
        ),
        "operators": sorted(dir(bpy.ops.cage_rig)),
        "menus": [name for name, found in draws.items() if _ours(found)],
        "keymaps": sum(len(keymap.keymap_items) for keymap in bpy.context.window_manager.keyconfigs.addon.keymaps)
        if bpy.context.window_manager.keyconfigs.addon
        else 0,
        "timers": [name for name in TIMERS if bpy.app.timers.is_registered(TIMERS[name])],
        "draw callbacks": len(_overlays().handles) if _overlays() else 0,
        "commands": len(_module("headless")._commands) if _module("headless") else 0,
        "node groups without users": [group.name for group in bpy.data.node_groups if group.users == 0],
    }


TIMERS: dict[str, object] = {}


def _ours(functions: list[object]) -> list[object]:
    return [found for found in functions if "cage_rig" in found.__module__]


def _module(name: str) -> object:
    return sys.modules.get(f"{extension.MODULE}.{name}")


def _overlays() -> object:
    module = _module("ui.overlays")
    return getattr(module, "_running", None)


def same(before: dict[str, object], when: str) -> None:
    for name, now in left_behind().items():
        if now != before[name]:
            print(f"WRONG {when}: {name}: {before[name]} became {now}")


def use() -> None:
    """The main job: bind, bend, fatten, key, bake, unbind."""
    import numpy as np
    from scene import bend, bound_bar, fat_key, rest, shown

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = bound_bar()
    bend(rig, 1.2)
    fat_key(rig, value=1.0)
    if np.abs(shown(rig.skin) - rest(rig.skin)).max() < 0.2:
        print("WRONG: the skin does not follow")
    module = _module("sync")
    TIMERS["sync"] = module._tag_again
    made = _module("bake").to_mesh_cache(rig.cage, str(Path(sys.argv[1]) / "baked.pc2"), 1, 3)
    if not made.files[0].exists():
        print("WRONG: nothing was baked")
    bpy.context.view_layer.objects.active = rig.cage
    bpy.ops.cage_rig.unbind()
    bpy.data.orphans_purge()


def main() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    before = left_behind()
    for turn in ("first", "second"):
        extension.install()
        use()
        now = left_behind()
        for name in ("handlers", "classes", "properties", "operators", "menus", "draw callbacks", "commands"):
            if now[name] == before[name]:
                print(f"WRONG: {turn}: no {name} are seen while it is enabled")
        addon_utils.disable(extension.MODULE, default_set=True)
        same(before, f"{turn}, disabled")
        addon_utils.enable(extension.MODULE, default_set=True)
        use()
        bpy.ops.extensions.package_uninstall(repo_index=_repository(), pkg_id="cage_rig")
        same(before, f"{turn}, removed")
        if list(_folder().glob("cage_rig/*")):
            print(f"WRONG: {turn}: files are left in {_folder()}")
    print("DONE")


def _repository() -> int:
    names = [repository.module for repository in bpy.context.preferences.extensions.repos]
    return names.index("user_default")


def _folder() -> Path:
    return Path(bpy.context.preferences.extensions.repos[_repository()].directory)


main()
