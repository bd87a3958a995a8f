"""Build the extension's zip for the platform of the wheel at hand, with Blender's own builder, and validate it."""

from __future__ import annotations

import argparse
import importlib.util
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
PLATFORMS = {
    "manylinux_2_28_x86_64": "linux-x64",
    "win_amd64": "windows-x64",
    "win_arm64": "windows-arm64",
    "macosx_11_0_arm64": "macos-arm64",
    "macosx_10_12_x86_64": "macos-x64",
}


def blender_builder() -> Path:
    """Blender's own command line for extensions, inside the bpy module."""
    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        sys.exit("build_extension: the bpy module is missing; run it through 'make extension'")
    found = sorted(Path(spec.origin).parent.rglob("bl_pkg/cli/blender_ext.py"))
    if not found:
        sys.exit(f"build_extension: {spec.origin} has no extension builder")
    return found[0]


def stage(wheel: Path, platform: str, folder: Path) -> None:
    """Lay out the extension's source with its wheel named in the manifest."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "addon", folder, ignore=shutil.ignore_patterns("__pycache__", "wheels"))
    (folder / "wheels").mkdir()
    shutil.copy(wheel, folder / "wheels")
    shutil.copy(ROOT / "LICENSE", folder)
    manifest = folder / "blender_manifest.toml"
    # before the first table, where every key still is the manifest's own
    manifest.write_text(f'platforms = ["{platform}"]\nwheels = ["./wheels/{wheel.name}"]\n' + manifest.read_text())


def run_builder(builder: Path, *arguments: str) -> None:
    """Call Blender's builder; show what it says only where it fails."""
    done = subprocess.run([sys.executable, str(builder), *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"build_extension: {' '.join(arguments)} failed\n{done.stdout}{done.stderr}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wheels", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    builder = blender_builder()
    for old in args.out.glob("cage_rig-*.zip"):
        old.unlink()
    for wheel in sorted(args.wheels.glob("cage_rig_core-*.whl")):
        tag = wheel.stem.split("-", 4)[-1].split(".")[0]
        if tag not in PLATFORMS:
            sys.exit(f"build_extension: no Blender platform is known for {wheel.name}")
        folder = ROOT / "build" / f"extension-{PLATFORMS[tag]}"
        stage(wheel, PLATFORMS[tag], folder)
        target = args.out / f"cage_rig-{PLATFORMS[tag]}.zip"
        run_builder(builder, "build", "--source-dir", str(folder), "--output-filepath", str(target))
        run_builder(builder, "validate", str(target))
        if f"wheels/{wheel.name}" not in zipfile.ZipFile(target).namelist():
            sys.exit(f"build_extension: {target} does not hold its wheel")
        print(f"{target}  {target.stat().st_size / 1e6:.2f} MB, validated")


if __name__ == "__main__":
    main()
