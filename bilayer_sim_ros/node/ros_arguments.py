"""The ROS arguments of a command line, read once more where ROS does not do what they say.

ROS keeps a value of each type of a parameter: a whole number from a parameter file hides a number with a point on the
command line, whichever comes later. It also drops parameters for names that no node has, and says nothing of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

ROS_ARGS, END_OF_ROS_ARGS = "--ros-args", "--"
PARAMETER_FLAGS, FILE_FLAG, REMAP_FLAGS = ("-p", "--param"), "--params-file", ("-r", "--remap")
FLAGS = (*PARAMETER_FLAGS, FILE_FLAG, *REMAP_FLAGS)
PARAMETERS = "ros__parameters"
"""Key of a parameter file under which a section has its parameters."""
ALL_NODES = "/**"


@dataclass(frozen=True)
class Given:
    """One value of a parameter, as it was given."""

    section: str
    """Full name of the node that it is for, possibly with ``*`` for one word and ``**`` for any number of words."""
    name: str
    value: Any
    file: str = ""  # Parameter file; empty for the command line

    def is_for(self, node: str) -> bool:
        """Return whether it is for the node of that full name."""
        return matches(self.section, node)


class _Reader(yaml.SafeLoader):
    """Safe YAML in which, as for ROS, ``1e3`` is a number."""


_Reader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$"), list("-+.0123456789")
)


def ros_options(argv: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the flag and the value of each parameter, parameter file and remapping of a command line."""
    inside, flag = False, ""
    for word in argv:
        if word in (ROS_ARGS, END_OF_ROS_ARGS):
            inside, flag = word == ROS_ARGS, ""
        elif flag:
            yield flag, word
            flag = ""
        elif inside and word in FLAGS:
            flag = word


def remap_sources(argv: Sequence[str]) -> Iterator[str]:
    """Yield the names that a command line remaps, as they stand there; not those of nodes and namespaces."""
    for flag, rule in ros_options(argv):
        source = rule.partition(":=")[0].rpartition(":")[2]  # a rule may begin with the name of a node
        if flag in REMAP_FLAGS and source and not source.startswith("__"):
            yield source


def given_parameters(argv: Sequence[str]) -> list[Given]:
    """Return all parameters that a command line and its parameter files give, in their order.

    A file that cannot be read gives none: ROS refuses it with the reason.
    """
    found: list[Given] = []
    for flag, text in ros_options(argv):
        if flag in PARAMETER_FLAGS:
            rule, _, value = text.partition(":=")
            node, _, name = rule.rpartition(":")
            found.append(Given(f"/{node}" if node else ALL_NODES, name, _read(value)))
        elif flag == FILE_FLAG:
            found += parameters_in(text)
    return found


def parameters_in(path: str) -> list[Given]:
    """Return the parameters in a file; none if it is not a parameter file that can be read."""
    try:
        content = _read(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    sections = _sections(content, "") if isinstance(content, Mapping) else ()
    return [Given(section, name, value, path) for section, part in sections for name, value in _flat(part, "")]


def matches(section: str, node: str) -> bool:
    """Return whether a section of a parameter file is for the node of that full name."""
    words = {"**": r"(/[^/]+)*", "*": r"/[^/]+"}
    pattern = "".join(words.get(word, "/" + re.escape(word)) for word in section.strip("/").split("/"))
    return re.fullmatch(pattern, node) is not None


def in_order(found: Iterable[Given], node: str) -> dict[str, list[Given]]:
    """Return what is given of each parameter of a node, so that the last value is the one that counts.

    That is the last one on the command line. Among files it is that of the section which the files name last, as in
    ROS, and in it that of the last file.
    """
    mine = [given for given in found if given.is_for(node)]
    sections = list(dict.fromkeys(given.section for given in mine if given.file))
    files = sorted((given for given in mine if given.file), key=lambda given: sections.index(given.section))
    values: dict[str, list[Given]] = {}
    for given in (*files, *(given for given in mine if not given.file)):
        values.setdefault(given.name, []).append(given)
    return values


def _read(text: str) -> Any:
    try:
        return yaml.load(text, _Reader)
    except yaml.YAMLError:
        return text


def _sections(content: Mapping, name: str) -> Iterator[tuple[str, Mapping]]:
    for key, part in content.items():
        if not isinstance(part, Mapping):
            continue
        if key == PARAMETERS:
            yield name, part
        else:
            yield from _sections(part, f"{name}/{str(key).strip('/')}")


def _flat(part: Mapping, prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in part.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
