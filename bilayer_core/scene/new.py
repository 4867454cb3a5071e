"""A new scene: the text of a template, or of another scene, under a name of its own."""

from __future__ import annotations

import re
from pathlib import Path

from bilayer_core.errors import SceneError
from bilayer_core.scene.bundled import SUFFIXES, bundled_templates
from bilayer_core.scene.faults import suggestion
from bilayer_core.scene.loader import find_scene, parse_scene, read_scene_file
from bilayer_core.scene.text import read_yaml

DEFAULT_TEMPLATE = "strip"
_NAME_LINE = re.compile(r"^name:[ \t]*[^\s#]+", re.MULTILINE)


def templates() -> dict[str, str]:
    """Return the title of each template by its name."""
    return {
        name: read_yaml(path.read_text(encoding="utf-8"), str(path))["title"]
        for name, path in bundled_templates().items()
    }


def name_from(path: Path) -> str:
    """Return the name of a scene that is written to `path`: its stem, made fit for topics and key paths."""
    words = re.findall(r"[A-Za-z0-9]+", path.stem)
    name = "_".join(words) or "robot"
    return name if name[0].isalpha() else f"robot_{name}"


def new_scene(path: Path, template: str = DEFAULT_TEMPLATE, origin: str | None = None) -> str:
    """Return the text of a scene that is to be written to `path`, comments included; it loads without faults.

    Parameters
    ----------
    path : Path
        From which the scene has its name.
    template : str
        Name of a bundled template.
    origin : str, optional
        Scene file or name of a bundled scene to copy, instead of a template.

    Raises
    ------
    SceneError
        If the path is not that of a scene, or template or origin do not exist or are faulty.
    """
    if path.suffix not in SUFFIXES:
        raise SceneError(f"{path}: must end in {' or '.join(SUFFIXES)}")
    found = bundled_templates()
    if origin is None and template not in found:
        raise SceneError(
            f"--template: {template} does not exist{suggestion(template, found)}; there are {', '.join(found)}"
        )
    source = found[template] if origin is None else find_scene(origin)
    text, replaced = _NAME_LINE.subn(f"name: {name_from(path)}", read_scene_file(source), count=1)
    if not replaced:
        raise SceneError(f"{source}: has no line that begins with `name:`, and cannot be copied under another name")
    parse_scene(text, str(source), directory=path.parent)
    return text
