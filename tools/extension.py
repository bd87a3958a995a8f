"""Install the extension's zip into the running bpy module, in a user folder of its own: as a person would."""

from __future__ import annotations

import os
import platform
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
MODULE = "bl_ext.user_default.cage_rig"


SYSTEMS = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}
MACHINES = {"x86_64": "x64", "AMD64": "x64", "arm64": "arm64", "aarch64": "arm64", "ARM64": "arm64"}


def zip_path() -> Path:
    """The built extension for this machine."""
    name = f"cage_rig-{SYSTEMS.get(platform.system())}-{MACHINES.get(platform.machine())}.zip"
    if not (ROOT / "dist" / name).exists():
        raise FileNotFoundError(f"no {name} in dist/; run 'make zip'")
    return ROOT / "dist" / name


def isolate() -> None:
    """Give Blender an empty user folder. Call before bpy is imported."""
    os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="cage_rig_blender_")


def install(path: Path | None = None) -> None:
    """Install and enable the extension in an empty file."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(
        repo="user_default", filepath=str(path or zip_path()), enable_on_install=True
    )
    if MODULE not in bpy.context.preferences.addons:
        raise RuntimeError("the extension did not enable; see the messages above")
