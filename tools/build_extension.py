"""Build the extension's zips, one a platform that has a wheel, with Blender's own builder, and validate them."""

from __future__ import annotations

import argparse
import importlib.util
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

from build_core import platform_of

ROOT = Path(__file__).parent.parent
SAMPLES = ROOT / "build/samples"  # by build_samples; made in the oldest Blender, so that all can open them
LEFT_OUT = shutil.ignore_patterns("__pycache__", "wheels")


def blender_builder() -> Path:
    """Blender's own command line for extensions, inside the bpy module."""
    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        sys.exit("build_extension: the bpy module is missing; run it through 'make zip'")
    found = sorted(Path(spec.origin).parent.rglob("bl_pkg/cli/blender_ext.py"))
    if not found:
        sys.exit(f"build_extension: {spec.origin} has no extension builder")
    return found[0]


def stage(wheel: Path, platform: str, folder: Path) -> None:
    """Lay out the extension's source with its wheel named in the manifest."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "addon", folder, ignore=LEFT_OUT)
    (folder / "wheels").mkdir()
    shutil.copy(wheel, folder / "wheels")
    shutil.copy(ROOT / "LICENSE", folder)
    if SAMPLES.exists():
        shutil.copytree(SAMPLES, folder / "sample_files", ignore=shutil.ignore_patterns("*.blend1"))
    manifest = folder / "blender_manifest.toml"
    # before the first table, where every key still is the manifest's own
    manifest.write_text(f'platforms = ["{platform}"]\nwheels = ["./wheels/{wheel.name}"]\n' + manifest.read_text())


def run_builder(builder: Path, *arguments: str) -> str:
    """Call Blender's builder; show what it says only where it fails."""
    done = subprocess.run([sys.executable, str(builder), *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"build_extension: {' '.join(arguments)} failed\n{done.stdout}{done.stderr}")
    return done.stdout


def check(target: Path, wheel: Path, platform: str) -> None:
    """Stop where a zip does not hold its wheel, whole, and says that it is for its platform."""
    archive = zipfile.ZipFile(target)
    manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    if f"wheels/{wheel.name}" not in archive.namelist() or manifest["wheels"] != [f"./wheels/{wheel.name}"]:
        sys.exit(f"build_extension: {target} does not hold its wheel")
    if archive.read(f"wheels/{wheel.name}") != wheel.read_bytes() or manifest["platforms"] != [platform]:
        sys.exit(f"build_extension: {target} holds another wheel than {wheel}")


def repack(target: Path) -> None:
    """The same files with the same date, in the order of their names: the same bytes from the same sources."""
    draft = target.with_suffix(".partial")
    with zipfile.ZipFile(target) as source, zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as made:
        for name in sorted(source.namelist()):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            made.writestr(entry, source.read(name))
    draft.replace(target)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wheels", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--index", action="store_true", help="also a repository index, for a server of your own")
    args = parser.parse_args()
    builder = blender_builder()
    args.out.mkdir(parents=True, exist_ok=True)
    for old in [*args.out.glob("cage_rig-*.zip"), *args.out.glob("index.*")]:
        old.unlink()
    for wheel in sorted(args.wheels.glob("cage_rig_core-*.whl")):
        platform = platform_of(wheel).blender
        if not platform:
            continue
        folder = ROOT / "build" / f"extension-{platform}"
        stage(wheel, platform, folder)
        target = args.out / f"cage_rig-{platform}.zip"
        run_builder(builder, "build", "--source-dir", str(folder), "--output-filepath", str(target))
        repack(target)
        run_builder(builder, "validate", str(target))
        check(target, wheel, platform)
        print(f"{target}  {target.stat().st_size / 1e6:.2f} MB, validated")
    if args.index:
        run_builder(builder, "server-generate", "--repo-dir", str(args.out), "--html")
        print(f"{args.out / 'index.json'}  the repository's index")


if __name__ == "__main__":
    main()
