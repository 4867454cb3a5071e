"""Scene files as text: YAML in and out."""

from __future__ import annotations

from typing import Any

import yaml

from bilayer_core.errors import SceneError

TEXT_WIDTH = 120
"""Of written lines, in characters."""


class _Reader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
    """Safe YAML in which a key that occurs twice is an error; plain YAML keeps the last one."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        """The mapping of a node; keys merged from elsewhere (``<<``) are no repetition."""
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in seen:
                problem = f"the key {key.value!r} occurs twice"
                raise yaml.constructor.ConstructorError(None, None, problem, key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def read_yaml(text: str, source: str) -> Any:
    """Content of YAML text.

    Raises
    ------
    SceneError
        With `source` (a file name), line and column, if it is not YAML or a key occurs twice.
    """
    try:
        return yaml.load(text, _Reader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise SceneError(f"{source}{place}: is not readable YAML: {error.problem}") from None
    except (yaml.YAMLError, RecursionError) as error:
        raise SceneError(f"{source}: is not readable YAML: {' '.join(str(error).split())}") from None


def write_yaml(data: dict) -> str:
    """YAML text that `read_yaml` reads back to the same data, numbers bit for bit."""
    return yaml.safe_dump(data, sort_keys=False, default_flow_style=None, allow_unicode=True, width=TEXT_WIDTH)
