"""A running hash of the states and inputs of a log, by which a reader notices those that are missing or changed.

The hash begins with the scene, versions, machine, settings and description. Each state adds its log time and its
seal, the CRC-32 of its values that it has anyway (`model.state`); each input adds its log time and its bytes. What the
hash is so far stands in the metadata record ``chain`` at the head of the file and after each chunk, and in the metadata
record ``run`` at the end: ``states`` and ``inputs`` so far, and ``digest``.

Readers count states and inputs, so that the hash still fits when another tool packs the same messages into other
chunks. It finds damage, not forgery: whoever changes a log can compute the hash anew.
"""

from __future__ import annotations

import hashlib
import json
import math
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from bilayer_core.log.file.log_chunks import LogFile
from bilayer_core.log.file.log_opening import damage_told, metadata_records
from bilayer_core.log.messages.cdr import decoded, read_float64_multi_array, seconds_text
from bilayer_core.log.messages.topics import INPUTS, LOG_NAMESPACE
from bilayer_core.observed.frame import Description

CHAIN = "chain"
"""Name of the metadata records with the hash so far."""
END = "run"
"""Name of the metadata record at the end of a log."""
HASHED = ("versions", "machine", "settings", "description")
"""Names of the metadata records with which the hash begins."""
STATE = f"{LOG_NAMESPACE}/state"
DIGEST_SIZE = 16
_STATE = struct.Struct("<Qd")
"""What a state adds: log time [ns] and seal."""
_INPUT = struct.Struct("<QI")
"""What stands before the bytes of an input: log time [ns] and their number."""
NO_SEAL = -1.0
"""What a state adds whose seal does not fit its values; seals are not negative."""


@dataclass(frozen=True)
class Link:
    """States and inputs up to some place in a log, and the hash of them."""

    states: int
    inputs: int
    digest: str

    @classmethod
    def of(cls, metadata: Mapping[str, str]) -> Self | None:
        """Return the link in a metadata record, or None if it has none."""
        if "digest" not in metadata:
            return None
        return cls(int(metadata["states"]), int(metadata["inputs"]), metadata["digest"])

    @property
    def messages(self) -> int:
        """Number of states and inputs."""
        return self.states + self.inputs

    def as_metadata(self) -> dict[str, str]:
        """Return it as the content of a metadata record."""
        return {"states": str(self.states), "inputs": str(self.inputs), "digest": self.digest}


class Chain:
    """The hash of a log, message by message.

    `scene_text`: scene in the log. `head`: metadata records by name; those of `HASHED` count.
    """

    def __init__(self, scene_text: str, head: Mapping[str, Mapping[str, str]]):
        begin = [scene_text, {name: dict(head[name]) for name in HASHED if name in head}]
        self._hash = hashlib.blake2b(json.dumps(begin, sort_keys=True).encode(), digest_size=DIGEST_SIZE)
        self._states = self._inputs = 0

    def add_state(self, time: int, seal: float) -> None:
        """Take in a state by its log time [ns] and its seal."""
        self._hash.update(_STATE.pack(time, seal))
        self._states += 1

    def add_input(self, time: int, data: bytes) -> None:
        """Take in the message of an input by its log time [ns] and its bytes."""
        self._hash.update(_INPUT.pack(time, len(data)) + data)
        self._inputs += 1

    @property
    def messages(self) -> int:
        """Number of states and inputs so far."""
        return self._states + self._inputs

    @property
    def link(self) -> Link:
        """The hash so far."""
        return Link(self._states, self._inputs, self._hash.hexdigest())


def place_in_state(description: Description, part: str) -> int | None:
    """Return where a part begins in a flat state, or None if states have none of its name."""
    place = 0
    for name, shape in description.state_layout:
        if name == part:
            return place
        place += math.prod(shape)
    return None


@dataclass(frozen=True)
class Wholeness:
    """Verdict of a log's hash on its states and inputs."""

    hashed: bool  # Whether the log has a hash; older ones have none
    whole: bool  # Whether all states and inputs that were written are there, unchanged, to the end of the run
    reason: str = ""  # What is wrong, as a sentence; empty where nothing is


def check_chain(path: str | Path, description: Description) -> Wholeness:
    """Compute the hash of a log, and compare it with what the log says of it.

    `description`: that of the log. Raises InputError if the file is no log, or is damaged.
    """
    path = Path(path)
    chain, links, end = _read_links(path, description.scene_text)
    if not links and end is None:
        return Wholeness(
            False,
            False,
            "an older version wrote it, without a hash of states and inputs: whether some are missing cannot be seen",
        )
    if links and links[0].messages == 0 and links.pop(0) != chain.link:
        return Wholeness(True, False, "its scene, versions, machine, settings or description were changed")
    expected = iter(links if end is None else [*links, end])
    wanted, good, last = next(expected, None), None, None
    seal = place_in_state(description, "seal")
    for topic, time, data in LogFile(path).messages({STATE, INPUTS.full_name()}):
        if topic == STATE:
            chain.add_state(time, _sound_seal(decoded(path, topic, time, data, read_float64_multi_array)[1], seal))
        else:
            chain.add_input(time, data)
        last = time
        while wanted is not None and wanted.messages == chain.messages:
            if wanted != chain.link:
                return _broken(f"some states or inputs up to t = {seconds_text(last)} s", good)
            good, wanted = last, next(expected, None)
    found = chain.link
    if wanted is not None and wanted.messages > found.messages:
        written = end or links[-1]
        there = f"{found.states} of {written.states} states and {found.inputs} of {written.inputs} inputs are there"
        return _broken("some states or inputs at the end", good, there)
    if wanted is not None or (end is not None and end != found):
        return _broken("some states or inputs at the end", good)
    if end is None:
        until = "it holds none" if last is None else f"the last one is of t = {seconds_text(last)} s"
        return Wholeness(
            True,
            False,
            f"it has no end, as it was cut off or is still being written: of its states and inputs, {until}",
        )
    return Wholeness(True, True)


def _broken(which: str, good: int | None, there: str = "") -> Wholeness:
    """Return what is wrong with some states or inputs, all before which up to a time [ns] are as they were written."""
    since = "" if good is None else f"; up to t = {seconds_text(good)} s all are as they were written"
    return Wholeness(True, False, f"{which} were changed, removed or added{since}{there and f' ({there})'}")


def _sound_seal(state: np.ndarray, place: int | None) -> float:
    """Return the seal of a state, or `NO_SEAL` if it does not fit the values."""
    if place is None:
        return 0.0
    values = state.copy()
    if place >= len(values):
        return NO_SEAL
    seal, values[place] = float(values[place]), 0.0
    return seal if seal == zlib.crc32(values) else NO_SEAL


def _read_links(path: Path, scene_text: str) -> tuple[Chain, list[Link], Link | None]:
    """Read the beginning of a log's hash, the links in its metadata in the order of messages, and its end."""
    head: dict[str, dict[str, str]] = {}
    links, end = [], None
    with damage_told(path):
        for name, values in metadata_records(path, (*HASHED, CHAIN, END)):
            if name == CHAIN:
                links.append(Link.of(values))
            elif name == END:
                end = Link.of(values)
            else:
                head[name] = values
    return Chain(scene_text, head), sorted(filter(None, links), key=lambda link: link.messages), end
