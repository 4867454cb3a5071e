"""Load scenes, and write them out again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from bilayer_core.errors import SceneError
from bilayer_core.printable import shortened
from bilayer_core.scene.bundled import bundled_scene, bundled_scenes, is_file_name
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.faults import tell
from bilayer_core.scene.limits import LARGEST_FILE, check_content, read_text
from bilayer_core.scene.overrides import Overrides, read_overrides
from bilayer_core.scene.text import read_yaml, write_yaml


def load_scene(scene: str | Path | Mapping[str, Any] | SceneConfig, overrides: Overrides = ()) -> SceneConfig:
    """Load and validate a scene.

    Parameters
    ----------
    scene : str, Path, mapping or Scene
        Path of a YAML file, name of a bundled scene, the content of a scene, or a scene. Files that a scene names are
        relative to its own file, for a mapping to the working directory.
    overrides : sequence of str, or mapping
        Values to change: ``["rods.arm.stations=100"]`` or ``{"rods.arm.stations": 100}``. A text may have a unit, a
        number is in SI units.

    Returns
    -------
    SceneConfig
        Frozen, in SI units.

    Raises
    ------
    SceneError
        One line for each fault: file, key path, the value found, what is allowed.
    """
    if isinstance(scene, SceneConfig):
        return load_content(scene_content(scene), overrides, f"scene {scene.name}") if overrides else scene
    if not isinstance(scene, Mapping | str | Path):
        demand = "must be the path of a scene file, the name of a bundled scene, a mapping, or a Scene"
        raise SceneError(f"scene: found {type(scene).__name__}; {demand}")
    if isinstance(scene, Mapping):
        return _validated(dict(scene), "scene", overrides, Path())
    path = find_scene(scene)
    return parse_scene(read_scene_file(path), str(path), overrides, path.parent)


def read_scene_file(path: Path) -> str:
    """Return the text of a scene file. SceneError if it cannot be read."""
    try:
        return read_text(path, LARGEST_FILE)
    except ValueError as error:
        known = path.stem in bundled_scenes() and len(path.parts) == 1 and not path.exists()
        hint = f"; `{path.stem}` without {path.suffix} is a bundled scene" if known else ""
        raise SceneError(f"{str(path)!r}: {error}" if "\0" in str(path) else f"{path}: {error}{hint}") from None


def parse_scene(text: str, source: str, overrides: Overrides = (), directory: Path = Path()) -> SceneConfig:
    """Validate the text of a scene; `source` begins each line of an error, and files that the scene names are
    relative to `directory`. Otherwise as `load_scene`.
    """
    return _validated(read_yaml(text, source), source, overrides, directory)


def scene_text(config: SceneConfig) -> str:
    """Return YAML that loads to the same configuration bit for bit: every value is written out, in SI units."""
    return write_yaml(scene_content(config))


def scene_content(config: SceneConfig) -> dict[str, Any]:
    """Return the content of a scene with every value written out, in SI units and with the tables of its files, as JSON
    has it.
    """
    return config.model_dump(mode="json", by_alias=True)


def load_content(content: dict[str, Any], overrides: Overrides, source: str = "scene") -> SceneConfig:
    """Load a scene from content that `scene_content` gave, with other values, which it takes in place.

    As `load_scene`, in half the time: what is written out is validated once, with the new values.
    """
    for change in read_overrides(overrides):
        change.apply(content)
    check_content(content, source)
    return _validate(content, source, Path())


def find_scene(scene: str | Path) -> Path:
    """Return a path if the argument is or looks like one, otherwise the path of the bundled scene of this name."""
    return Path(scene) if is_file_name(scene) else bundled_scene(str(scene))


def _validated(data: Any, source: str, overrides: Overrides, directory: Path) -> SceneConfig:
    if data is None:
        raise SceneError(f"{source}: is empty; `bilayer new FILE` writes a scene to start from")
    if not isinstance(data, dict):
        raise SceneError(
            f"{source}: found {type(data).__name__}; must be a mapping of keys to values, see the bundled scenes"
        )
    check_content(data, source)
    config = _validate(data, source, directory)
    if not overrides:
        return config
    changed = shortened(" ".join(change.text for change in read_overrides(overrides)))
    return load_content(scene_content(config), overrides, f"{source} with {changed}")


def _validate(data: dict[str, Any], source: str, directory: Path) -> SceneConfig:
    try:
        return SceneConfig.model_validate(data, context={"directory": directory})
    except ValidationError as error:
        raise SceneError(tell(error, SceneConfig, data, source)) from None
