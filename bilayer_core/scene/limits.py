"""How large a scene may be: what is larger is refused before anything is made of it, so that reading takes less than
ten seconds and two gigabytes, whatever the input.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol

from bilayer_core.errors import SceneError
from bilayer_core.printable import shortened
from bilayer_core.scene.faults import Fault

LARGEST_FILE = 2_000_000
"""Of a scene [bytes]. Long lists of points or values belong into csv files."""
LARGEST_TABLE = 3_000_000
"""Of a csv file [bytes]."""
MOST_VALUES = 200_000
"""Entries of all lists and mappings of a scene, repetitions by aliases included."""
DEEPEST = 50
"""Lists and mappings inside each other; scenes need nine."""
TOO_DEEP = f"has lists and mappings more than {DEEPEST} deep inside each other; no scene needs that"
MOST_COPIES = 1_000
"""Rods of a pattern, and of a scene."""
MOST_NODES = 200_000
"""Of all layers of all rods."""
MOST_POINTS = 10_000
"""Contact points of a surface."""
MOST_SIGHTS = 1e8
"""Pairs of an element that follows a light and an edge that may stand before it: all are looked at in every step."""
MEMORY_PER_NODE = 5e3
"""Of a built simulation, two rods in space with contact, as measured [bytes]."""
LOG_MAGIC = b"\x89MCAP"


class Rods(Protocol):
    """A scene, as far as its size goes: see `bilayer_core.scene.config.SceneConfig`."""

    rods: list
    stimuli: dict


def read_text(path: Path, largest: int) -> str:
    """Return the text of a regular file in UTF-8, with or without a byte order mark.

    Raises ValueError with the reason, if there is none: it is missing, a directory, a device or a pipe, too large, or
    no text.
    """
    try:
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):
            kind = "a directory" if stat.S_ISDIR(status.st_mode) else "a device or a pipe"
            raise ValueError(f"is {kind}, not a file")
        with open(path, "rb") as file:
            data = file.read(largest + 1)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    if data.startswith(LOG_MAGIC):
        raise ValueError("is an MCAP log, not a scene: see `bilayer info`, `bilayer view` and `bilayer render`")
    if len(data) > largest:
        raise ValueError(f"is larger than {largest / 1e6:g} MB, the most that is read")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"is not UTF-8 text: {error.reason} at byte {error.start}") from None


NESTED = dict, list, tuple, Mapping
"""What has values inside; the frequent ones first."""


def check_content(data: Any, source: str) -> None:
    """Raise SceneError if the content of a scene is too deep or too large, contains itself, or has unwritable text."""
    count, level = 0, [data]
    for _ in range(DEEPEST + 1):
        inside: list[Any] = []
        for item in level:
            entries = _entries(item)
            count += len(entries)
            inside += [entry for entry in entries if isinstance(entry, NESTED)]
            _refuse_unwritable([entry for entry in entries if isinstance(entry, str)], source)
            if count > MOST_VALUES:
                raise SceneError(
                    f"{source}: has more than {MOST_VALUES} values, aliases written out, which is the most that is "
                    "read; long lists of points and values go into csv files"
                )
        if not inside:
            return
        level = inside
    raise SceneError(f"{source}: {TOO_DEEP}")


def _refuse_unwritable(texts: list[str], source: str) -> None:
    """Raise SceneError if a text cannot be written to any file: one half of a pair of surrogates."""
    for text in texts:
        try:
            text.encode()
        except UnicodeEncodeError as error:
            raise SceneError(f"{source}: the text {shortened(text)!r} is not UTF-8: {error.reason}") from None


def _entries(item: Any) -> list[Any]:
    if isinstance(item, Mapping):
        return list(item.values())
    return list(item) if isinstance(item, list | tuple) else []


def faults_of_size(scene: Rods) -> list[Fault]:
    """Return the faults of a scene with too many rods or nodes to be built, with the memory that they would take."""
    sizes = [(rod.pattern.copies if rod.pattern else 1, rod.stations * len(rod.layers)) for rod in scene.rods]
    copies = sum(copies for copies, _ in sizes)
    if copies > MOST_COPIES:
        return [(("rods",), f"{copies} rods", f"must be at most {MOST_COPIES}, copies of patterns included")]
    nodes = sum(copies * own for copies, own in sizes)
    if nodes <= MOST_NODES:
        return _faults_of_light(scene, sizes, nodes)
    largest = max(range(len(sizes)), key=lambda index: sizes[index][0] * sizes[index][1])
    memory = 1e-9 * MEMORY_PER_NODE * nodes
    return [
        (
            ("rods", largest, "stations"),
            scene.rods[largest].stations,
            f"must be fewer: the scene would have {nodes} nodes, and take about {memory:.3g} GB; at most {MOST_NODES} "
            "are simulated",
        )
    ]


def _faults_of_light(scene: Rods, sizes: list[tuple[int, int]], nodes: int) -> list[Fault]:
    """Return a fault if so many elements of layers follow lights that a look at all of them would take seconds."""
    lights = {name for name, channel in scene.stimuli.items() if channel.light is not None}
    lit = [
        copies * rod.stations * sum(law.stimulus in lights for layer in rod.layers for law in layer.eigenstrain)
        for rod, (copies, _) in zip(scene.rods, sizes, strict=True)
    ]
    if sum(lit) * nodes <= MOST_SIGHTS:
        return []
    largest = lit.index(max(lit))
    demand = (
        f"must be fewer: {sum(lit)} elements follow lights, and each has {nodes} nodes to look at; the product may be "
        f"{MOST_SIGHTS:g}"
    )
    return [(("rods", largest, "stations"), scene.rods[largest].stations, demand)]


def refused_file_name(name: str) -> str:
    """Return why a file that a scene names is not one of its folder; empty if it is."""
    if "\0" in name or not name:
        return "must be the name of a file"
    parts = Path(os.path.normpath(name)).parts
    if os.path.isabs(name) or parts[:1] == ("..",):
        return "must be a file in the scene's folder or below it"
    return ""


def longest(items: Iterable[str], most: int = 60) -> str:
    """Return the items in a row, cut off where they get long."""
    return shortened(", ".join(items), most)
