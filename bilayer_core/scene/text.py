"""Scene files as text: YAML in and out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import yaml

from bilayer_core.errors import SceneError
from bilayer_core.scene.limits import TOO_DEEP

TEXT_WIDTH = 120
"""Of written lines, in characters."""
FEW = 1000
"""Lists and mappings inside each other that the reader takes; it crashes at some ten thousand."""
OPENERS = ("[", "{", "- ", "? ")
"""Without which nothing begins inside something else on one line; a deeper line is longer than its depth."""
PLAIN = "tag:yaml.org,2002:"
MERGE = PLAIN + "merge"
KINDS = ("null", "bool", "int", "float", "str", "seq", "map")
"""Of values; YAML has more, such as dates and sets, which mean nothing in a scene."""
_Base = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_Writer = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def _checked(construct: Callable, what: str) -> Callable:
    """Return a constructor of numbers whose errors say where they are."""

    def number(reader: _Reader, node: yaml.Node) -> Any:
        try:
            return construct(reader, node)
        except (ValueError, OverflowError, KeyError, IndexError):
            shown = str(node.value)[:20]
            problem = f"{shown!r}{'...' if len(node.value) > len(shown) else ''} is not {what}"
            raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark) from None

    return number


class _Reader(_Base):
    """Safe YAML with plain values alone: keys are text, also those that YAML takes for true (``on``, ``yes``) or for
    numbers, dates are text, and a key that occurs twice is an error, where plain YAML keeps the last one.
    """

    yaml_constructors = {PLAIN + kind: _Base.yaml_constructors[PLAIN + kind] for kind in KINDS} | {
        PLAIN + "int": _checked(_Base.construct_yaml_int, "a whole number that can be read"),
        PLAIN + "float": _checked(_Base.construct_yaml_float, "a number"),
        PLAIN + "bool": _checked(_Base.construct_yaml_bool, "true or false"),
        None: _Base.construct_undefined,
    }
    yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag.removeprefix(PLAIN) in (*KINDS, "merge")]
        for first, resolvers in _Base.yaml_implicit_resolvers.items()
    }

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[str, Any]:
        """Return the mapping of a node; keys merged from elsewhere (``<<``) are no repetition."""
        if not isinstance(node, yaml.MappingNode):
            raise yaml.constructor.ConstructorError(None, None, "this is not a mapping", node.start_mark)
        seen, merges = set(), False
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(None, None, "a key must be plain text", key.start_mark)
            if key.value in seen:
                problem = f"the key {key.value!r} occurs twice"
                raise yaml.constructor.ConstructorError(None, None, problem, key.start_mark)
            seen.add(key.value)
            merges |= key.tag == MERGE
        if merges:
            self.flatten_mapping(node)
        return {key.value: self.construct_object(value, deep=deep) for key, value in node.value}


def read_yaml(text: str, source: str) -> Any:
    """Return the content of YAML text.

    Raises
    ------
    SceneError
        With `source` (a file name), line and column, if it is not YAML, has other values than plain ones, or a key
        occurs twice.
    """
    try:
        data = text.encode()
    except UnicodeEncodeError as error:
        raise SceneError(f"{source}: is not UTF-8 text: {error.reason} at character {error.start + 1}") from None
    try:
        _refuse_deep(text, source)
        return yaml.load(text, _Reader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        if "another document" in str(error.problem):
            raise SceneError(f"{source}{place}: begins another document; a scene is a single one") from None
        if "nesting depth" in str(error.problem):  # of 1000, where the reader has a limit of its own
            raise SceneError(f"{source}{place}: {TOO_DEEP}") from None
        raise SceneError(f"{source}{place}: is not readable YAML: {_problem(error)}") from None
    except yaml.reader.ReaderError as error:
        before = text[: error.position] if _Base is yaml.SafeLoader else data[: error.position].decode(errors="ignore")
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        character = error.character if isinstance(error.character, int) else ord(error.character)
        raise SceneError(
            f"{source}:{line}:{column}: is not readable YAML: the character U+{character:04X} is not allowed"
        ) from None
    except (yaml.YAMLError, RecursionError) as error:
        raise SceneError(f"{source}: is not readable YAML: {' '.join(str(error).split())}") from None


def _problem(error: yaml.MarkedYAMLError) -> str:
    tag = "could not determine a constructor for the tag "
    problem = str(error.problem)
    if problem.startswith(tag):
        return f"the tag {problem.removeprefix(tag)} means nothing in a scene"
    return next((f"{problem}; {remedy}" for part, remedy in REMEDIES.items() if part in problem), problem)


REMEDIES = {
    "tab character": "lines are indented with spaces",
    "cannot start any token": "lines are indented with spaces, and text with special characters needs quotes",
    "mapping values are not allowed": "text with a colon needs quotes, such as title: 'Gripper: first trial'",
}
"""Of faults that the reader's words do not help to mend, by a part of these."""


def _refuse_deep(text: str, source: str) -> None:
    """Raise SceneError if text has so many lists and mappings inside each other that the reader would crash."""
    if sum(text.count(opener) for opener in OPENERS) <= FEW:
        return
    depth = 0
    for event in yaml.parse(text, _Base):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > FEW:
                mark = event.start_mark
                raise SceneError(f"{source}:{mark.line + 1}:{mark.column + 1}: {TOO_DEEP}")
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def write_yaml(data: dict) -> str:
    """Return YAML text that `read_yaml` reads back to the same data, numbers bit for bit."""
    form = {"sort_keys": False, "default_flow_style": None, "allow_unicode": True, "width": TEXT_WIDTH}
    return yaml.dump(data, Dumper=_Writer, **form)
