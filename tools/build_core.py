"""Build the core's wheel: abi3, one for Blender 4.2 to 5.2. For this machine, or cross-compiled through zig."""

from __future__ import annotations

import argparse
import base64
import hashlib
import os
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent


@dataclass(frozen=True)
class Platform:
    """A platform that Blender runs on, by the name it has in Blender's manifests; empty: none of Blender's."""

    blender: str
    target: str  # Rust's name of it
    tag: str  # Python's, of the wheel
    native: str  # how the compiled module in the wheel ends
    machine: str  # what its header says that it runs on; see `machine_of`


PLATFORMS = (
    Platform("linux-x64", "x86_64-unknown-linux-gnu", "manylinux_2_28_x86_64", ".abi3.so", "ELF x64"),
    # for the package index
    Platform("", "aarch64-unknown-linux-gnu", "manylinux_2_28_aarch64", ".abi3.so", "ELF arm64"),
    Platform("windows-x64", "x86_64-pc-windows-gnu", "win_amd64", ".pyd", "PE x64"),
    Platform("windows-arm64", "aarch64-pc-windows-gnullvm", "win_arm64", ".pyd", "PE arm64"),
    Platform("macos-arm64", "aarch64-apple-darwin", "macosx_11_0_arm64", ".abi3.so", "Mach-O arm64"),
    Platform("macos-x64", "x86_64-apple-darwin", "macosx_10_12_x86_64", ".abi3.so", "Mach-O x64"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--all", action="store_true", help="for every platform, not only for this machine")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for old in args.out.glob("cage_rig_core-*.whl"):
        old.unlink()
    if args.all:
        targets = [platform.target for platform in PLATFORMS]
        done = subprocess.run(["rustup", "target", "add", *targets], check=False)
        if done.returncode:
            sys.exit("build_core: rustup can't add the targets of the other platforms; see above")
        for platform in PLATFORMS:
            build(args.out, ["--target", platform.target, "--zig", *_linux(platform.target)])
    else:
        build(args.out, ["--zig", *_linux("linux")] if sys.platform == "linux" else [])
    for wheel in sorted(args.out.glob("cage_rig_core-*.whl")):
        forget_folder(wheel)
        check(wheel)
        print(f"{wheel}  {wheel.stat().st_size / 1e6:.2f} MB")


def _linux(target: str) -> list[str]:
    """An old glibc where the wheel is for Linux."""
    return ["--compatibility", "manylinux_2_28"] if "linux" in target else []


def build(out: Path, arguments: list[str]) -> None:
    """One wheel, the same bytes every time from the same sources."""
    command = [
        sys.executable,
        "-m",
        "maturin",
        "build",
        "--release",
        "--locked",
        "--quiet",
        "--out",
        str(out),
        *arguments,
    ]
    command += ["--manifest-path", str(ROOT / "rust_core/cage_rig_py/Cargo.toml")]
    # maturin looks for zig (the ziglang package) through the python3 on PATH
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    stamp = subprocess.run(["git", "log", "-1", "--format=%ct"], cwd=ROOT, capture_output=True, text=True, check=False)
    reproducible = {
        "SOURCE_DATE_EPOCH": stamp.stdout.strip() or "1735689600",
        "RUSTFLAGS": f"{os.environ.get('RUSTFLAGS', '')} --remap-path-prefix={ROOT}=/cage-rig "
        f"--remap-path-prefix={Path.home()}=/home".strip(),
    }
    subprocess.run(command, check=True, env={**os.environ, **reproducible, "PATH": path})


def forget_folder(wheel: Path, folder: Path = ROOT) -> None:
    """Take the folder that a wheel was built in out of its list of crates (SBOM), where maturin names it."""
    with zipfile.ZipFile(wheel) as source:
        entries = {info: source.read(info) for info in source.infolist()}
    (record,) = (info for info in entries if info.filename.endswith(".dist-info/RECORD"))
    for info in [info for info in entries if "/sboms/" in info.filename]:
        text = entries[info].replace(folder.as_uri().encode(), b"file:///cage-rig")
        old, new = (_record(info.filename, part) for part in (entries[info], text))
        if old not in entries[record]:
            sys.exit(f"build_core: {wheel.name} has no record of its {info.filename}")
        entries[info], entries[record] = text, entries[record].replace(old, new)
    draft = wheel.with_suffix(".partial")
    with zipfile.ZipFile(draft, "w") as made:
        for info, content in entries.items():
            made.writestr(info, content, compress_type=info.compress_type, compresslevel=9)
    draft.replace(wheel)


def _record(name: str, content: bytes) -> bytes:
    """A file's line in a wheel's RECORD."""
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(content)}".encode()


def platform_of(wheel: Path) -> Platform:
    """The platform that a wheel is for, by its tag."""
    tag = wheel.stem.split("-", 4)[-1].split(".")[0]
    for platform in PLATFORMS:
        if platform.tag == tag:
            return platform
    sys.exit(f"build_core: no platform is known for {wheel.name}")


def check(wheel: Path) -> None:
    """Stop where a wheel does not hold its compiled module, stub and licences, or is not for every Python from 3.11."""
    platform, names = platform_of(wheel), zipfile.ZipFile(wheel).namelist()
    if "-cp311-abi3-" not in wheel.name:
        sys.exit(f"build_core: {wheel.name} is not abi3 for Python 3.11 and later")
    wanted = (f"cage_rig_core{platform.native}", ".pyi", "py.typed", "LICENSE-MIT", "LICENSE-APACHE")
    missing = [end for end in wanted if not any(name.endswith(end) for name in names)]
    if missing:
        sys.exit(f"build_core: {wheel.name} has no {', '.join(missing)}; it has {', '.join(names)}")
    native = next(name for name in names if name.endswith(f"cage_rig_core{platform.native}"))
    found = machine_of(zipfile.ZipFile(wheel).read(native))
    if found != platform.machine:
        sys.exit(f"build_core: the module in {wheel.name} is for {found}, not for {platform.machine}")


def machine_of(module: bytes) -> str:
    """What a compiled module runs on, by its header."""
    if module[:4] == b"\x7fELF":
        return {62: "ELF x64", 183: "ELF arm64"}.get(int.from_bytes(module[18:20], "little"), "another ELF machine")
    if module[:4] == b"\xcf\xfa\xed\xfe":
        kinds = {0x01000007: "Mach-O x64", 0x0100000C: "Mach-O arm64"}
        return kinds.get(int.from_bytes(module[4:8], "little"), "another Mach-O machine")
    start = int.from_bytes(module[60:64], "little")
    if module[:2] == b"MZ" and module[start : start + 4] == b"PE\0\0":
        kinds = {0x8664: "PE x64", 0xAA64: "PE arm64"}
        return kinds.get(int.from_bytes(module[start + 4 : start + 6], "little"), "another PE machine")
    return "nothing known"


if __name__ == "__main__":
    main()
