"""How Sphinx makes the manual: `make docs`. Offline: nothing is loaded from elsewhere when it is built or read."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent

project = "Cage Rig"
author = "Cage Rig developers"
release = version = tomllib.loads((ROOT / "addon/blender_manifest.toml").read_text())["version"]
language = "en"

extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["make_pictures", "listing", "generate_bench.md", "generate_fit_bench.md"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
smartquotes = False  # messages read as on the screen, so that they are found
nitpicky = True

html_theme = "furo"
html_title = f"Cage Rig {release}"
html_static_path = ["style"]
html_css_files = ["manual.css"]
html_copy_source = False
html_show_sphinx = False
