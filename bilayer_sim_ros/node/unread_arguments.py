"""Arguments of an executable that nobody reads: ROS drops them in silence, so the node says what to write instead."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from bilayer_core.errors import InputError
from bilayer_core.printable import shortened
from bilayer_sim_ros.node.near_misses import nearest
from bilayer_sim_ros.node.ros_arguments import (
    ALL_NODES,
    END_OF_ROS_ARGS,
    FILE_FLAG,
    FLAGS,
    PARAMETER_FLAGS,
    REMAP_FLAGS,
    ROS_ARGS,
    given_parameters,
    matches,
    parameters_in,
    ros_options,
)

MOST_SECTIONS = 5
"""Of a parameter file that a warning names."""


def refuse_bare_parameters(argv: Sequence[str], names: Collection[str]) -> None:
    """Raise InputError for a word such as ``scene:=x`` without ``-p``, which ROS takes for a remapping of a topic.

    `argv`: the command line. `names`: of all parameters.
    """
    before = ""
    for word in argv[1:]:
        name, separator, value = word.partition(":=")
        meant = nearest(name, names) if separator and before not in FLAGS else ""
        if meant:
            instead = shortened(f"{ROS_ARGS} -p {meant}:={value}")
            raise InputError(f"'{shortened(word)}' sets no parameter, as it has no -p before it; write {instead}")
        before = word if word not in (ROS_ARGS, END_OF_ROS_ARGS) else ""


def unread_arguments(argv: Sequence[str], node: str, names: Collection[str]) -> Iterator[str]:
    """Yield what to say of parameters for other nodes than the only one of a process.

    `argv`: the command line. `node`: full name of the node. `names`: of all its parameters.
    """
    for flag, text in ros_options(argv):
        if flag == FILE_FLAG:
            yield from _unread_sections(text, node)
        elif flag in REMAP_FLAGS:
            name, _, value = text.partition(":=")
            if name in names:
                rule = shortened(f"-p {name}:={value}")
                yield f"-r {name} remaps a topic or a service of that name, not the parameter; for that write {rule}"
        elif flag in PARAMETER_FLAGS:
            (given,) = given_parameters([ROS_ARGS, flag, text])
            if not given.is_for(node):
                yield (
                    f"-p {shortened(text)} is not read: it is for the node {shortened(given.section)}, "
                    f"this one is {node}; write -p {shortened(given.name)}:=..."
                )


def _unread_sections(file: str, node: str) -> Iterator[str]:
    """Yield what to say of a parameter file without a section for a node, or with a misspelt one."""
    sections = list(dict.fromkeys(given.section for given in parameters_in(file)))
    read = [section for section in sections if matches(section, node)]
    if sections and not read:
        found = shortened(", ".join(sections[:MOST_SECTIONS]))
        yield (
            f"nothing of {shortened(file)} is read: its parameters are for {found}, this node is {node}; "
            f"write {node}: or {ALL_NODES}: above them"
        )
    elif all("*" in section for section in read):
        for section in sections:
            apart = section.rpartition("/")[0] != node.rpartition("/")[0]
            if section not in read and not apart and nearest(section, [node]):
                yield f"{shortened(file)}: the parameters of {shortened(section)} are not read: did you mean {node}?"
