"""What holds of the project as a whole: versions, licences, workflows, and Blender's rules for extensions."""

from __future__ import annotations

import ast
import json
import re
import struct
import subprocess
import tomllib
import zipfile
from pathlib import Path

import build_core
import check_version
import pytest
import yaml

ROOT = Path(__file__).parent.parent
ADDON = sorted((ROOT / "addon").rglob("*.py"))
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))


def test_the_version_is_the_same_everywhere() -> None:
    assert len(set(check_version.versions().values())) == 1
    assert check_version.versions("v9.9.9")["tag"] == "9.9.9"


def alternatives(expression: str) -> list[set[str]]:
    """A licence expression as the sets of licences, one of which has to be allowed wholly."""
    text = expression.replace("/", " OR ")
    group = re.match(r"\((.*)\) AND (.*)", text)
    if group:
        return [found | {group[2]} for found in alternatives(group[1])]
    return [set(part.split(" AND ")) for part in text.split(" OR ")]


def test_every_crate_has_a_licence_that_is_allowed() -> None:
    allowed = set(tomllib.loads((ROOT / "deny.toml").read_text())["licenses"]["allow"])
    command = ["cargo", "metadata", "--format-version", "1", "--locked"]
    found = json.loads(subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout)["packages"]
    assert len(found) > 50
    for package in found:
        assert package["license"], package["name"]
        assert any(part <= allowed for part in alternatives(package["license"])), (package["name"], package["license"])
    assert not any("AGPL" in package["license"] for package in found)


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_workflows_call_what_is_there(path: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    text = path.read_text()
    jobs = yaml.safe_load(text)["jobs"]
    called = set(re.findall(r"\bmake ([a-z-]+)", text))
    assert jobs and called and called <= targets
    for script in re.findall(r"python (tools/\S+)", text):
        assert (ROOT / script).exists(), script
    for job in jobs.values():
        assert set(job.get("needs", "").split()) <= set(jobs)


@pytest.mark.parametrize("path", ADDON, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_add_on_keeps_to_the_rules_for_extensions(path: Path) -> None:
    """Relative imports, no threads of Python's, no network, no code from text, no change of the search path."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [node.module or ""]
        for name in names:
            assert name.split(".")[0] not in FORBIDDEN, f"{name} at line {node.lineno}"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in {"eval", "exec", "compile", "__import__"}, f"line {node.lineno}"
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert (node.value.id, node.attr) not in {("sys", "path"), ("os", "system")}, f"line {node.lineno}"


FORBIDDEN = {
    "threading",
    "concurrent",
    "multiprocessing",
    "asyncio",
    "socket",
    "urllib",
    "http",
    "requests",
    "subprocess",
}
FORBIDDEN |= {"addon", "cage_rig", "ctypes", "pip"}


def test_the_manifest_asks_for_files_only() -> None:
    manifest = tomllib.loads((ROOT / "addon/blender_manifest.toml").read_text())
    assert set(manifest["permissions"]) == {"files"}, "nothing of it is online"
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"] and len(manifest["tagline"]) <= 64


def test_a_wheel_forgets_where_it_was_built(tmp_path: Path) -> None:
    """And is the same file wherever that was, with a record that fits."""
    made = []
    for folder in ("/home/one", "/somewhere/else"):
        text = f'{{"bom-ref": "path+file://{folder}/rust_core/cage_rig#0.1.0"}}'.encode()
        wheel = tmp_path / f"{len(made)}.whl"
        with zipfile.ZipFile(wheel, "w") as archive:
            for name, content in (
                ("x/__init__.py", b"pass"),
                ("x.dist-info/sboms/x.json", text),
                ("x.dist-info/RECORD", build_core._record("x.dist-info/sboms/x.json", text) + b"\n"),
            ):
                archive.writestr(zipfile.ZipInfo(name), content)
        build_core.forget_folder(wheel, Path(folder))
        made.append(wheel.read_bytes())
        found = zipfile.ZipFile(wheel)
        assert folder.encode() not in found.read("x.dist-info/sboms/x.json")
        line = build_core._record("x.dist-info/sboms/x.json", found.read("x.dist-info/sboms/x.json"))
        assert line in found.read("x.dist-info/RECORD")
    assert made[0] == made[1]


def test_the_python_package_has_all_that_an_index_shows() -> None:
    folder = ROOT / "rust_core/cage_rig_py"
    project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    assert {"description", "readme", "license", "license-files", "authors", "keywords", "classifiers"} <= set(project)
    assert all((folder / name).exists() for name in [project["readme"], *project["license-files"], "cage_rig_core.pyi"])
    assert "Typing :: Typed" in project["classifiers"]
    assert not any(line.startswith("License ::") for line in project["classifiers"]), "the expression says it"


def test_a_module_for_another_machine_is_not_let_pass() -> None:
    elf = bytearray(64)
    elf[:4], elf[18] = b"\x7fELF", 183
    assert build_core.machine_of(bytes(elf)) == "ELF arm64"
    assert build_core.machine_of(b"\xcf\xfa\xed\xfe\x07\x00\x00\x01") == "Mach-O x64"
    assert build_core.machine_of(b"MZ" + bytes(58) + b"\x40\0\0\0" + b"PE\0\0\x64\xaa") == "PE arm64"
    assert build_core.machine_of(b"") == "nothing known"
    assert len({platform.machine for platform in build_core.PLATFORMS}) == len(build_core.PLATFORMS)


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height, as the header of a PNG or JPEG says."""
    data = path.read_bytes()
    if data.startswith(b"\x89PNG"):
        return struct.unpack(">II", data[16:24])
    at = 2
    while data[at + 1] not in (0xC0, 0xC1, 0xC2):
        at += 2 + struct.unpack(">H", data[at + 2 : at + 4])[0]
    height, width = struct.unpack(">HH", data[at + 5 : at + 9])
    return width, height


def test_the_listing_is_complete() -> None:
    """As Blender's extension site asks: a square icon, pictures of 16 to 9, the manifest's words."""
    folder = ROOT / "docs/listing"
    text = (folder / "listing.md").read_text()
    manifest = tomllib.loads((ROOT / "addon/blender_manifest.toml").read_text())
    assert manifest["tagline"] in text and ", ".join(manifest["tags"]) in text
    assert picture_size(folder / "icon.png") == (256, 256)
    named = set(re.findall(r"`(\w+\.jpg)`", text))
    assert len(named) >= 4 and named == {path.name for path in folder.glob("*.jpg")}
    for name in named:
        assert picture_size(folder / name) == (1920, 1080), name
        assert (folder / name).stat().st_size < 600_000, name
