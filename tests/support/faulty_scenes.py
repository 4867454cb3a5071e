"""Scenes with one value changed, and the faults that are found in a scene."""

import pytest
from support.sample_scenes import everything

from bilayer_core import load_scene
from bilayer_core.errors import SceneError

DELETE = object()


def changed(path, value):
    """A sound scene with one value changed; items of lists are addressed by name."""
    content = everything()
    *parents, last = path.replace("[", ".").replace("]", "").split(".")
    here = content
    for part in parents:
        named = {item["name"]: item for item in here if isinstance(item, dict)} if isinstance(here, list) else here
        here = named[part]
    if value is DELETE:
        del here[last]
    else:
        here[int(last) if last.isdecimal() else last] = value
    return content


def faults_of(content) -> list[str]:
    with pytest.raises(SceneError) as refused:
        load_scene(content)
    return str(refused.value).splitlines()
