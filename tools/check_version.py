"""Stop where the version is not the same everywhere: in Cargo.toml, the manifest, the change log, and the tag given."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent


def versions(tag: str | None = None) -> dict[str, str]:
    """Where the version is written, and what is written there."""
    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text())
    manifest = tomllib.loads((ROOT / "addon/blender_manifest.toml").read_text())
    heading = re.search(r"^## \[?(\d+\.\d+\.\d+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    found = {
        "Cargo.toml": cargo["workspace"]["package"]["version"],
        "addon/blender_manifest.toml": manifest["version"],
        "CHANGELOG.md": heading[1] if heading else "no version",
    }
    return found if tag is None else {**found, "tag": tag.removeprefix("v")}


def main() -> None:
    found = versions(sys.argv[1] if len(sys.argv) > 1 else None)
    if len(set(found.values())) != 1:
        sys.exit("check_version: " + ", ".join(f"{where} says {version}" for where, version in found.items()))
    print(f"version {next(iter(found.values()))}")


if __name__ == "__main__":
    main()
