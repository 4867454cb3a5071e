"""The files of a bag of ``ros2 bag record``: one MCAP file, or a directory of them, read as one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from bilayer_core.errors import InputError
from bilayer_core.log.file.log_chunks import LogFile
from bilayer_core.log.file.log_head import is_log
from bilayer_core.log.file.log_opening import CONVERT

SUFFIX = ".mcap"
OTHERS = {".db3": "a bag stored with sqlite3", ".zstd": "a bag whose files are compressed as a whole"}
"""What is not read, by the end of a file's name."""


class BagFiles:
    """One MCAP file, or those of a bag's directory in the order of their times, as one.

    A directory needs no ``metadata.yaml``, which a recorder that was killed does not write.

    Parameters
    ----------
    path : Path
        Of the file or the directory.

    Attributes
    ----------
    path : Path
    parts : list of LogFile
    topics : dict
        Full name of each topic -> type.

    Raises
    ------
    InputError
        If it is no bag in MCAP, or a file is damaged.
    """

    def __init__(self, path: Path):
        self.path = path
        self.parts = sorted(map(LogFile, _files_of(path)), key=_begin)
        self.topics = {topic: of for part in self.parts for topic, of in part.topics.items()}

    def encodings(self, topic: str) -> set[str]:
        """Return how the messages of a topic are encoded: ``cdr`` for those of ROS 2."""
        return {of.message_encoding for part in self.parts for of in part.channels.values() if of.topic == topic}

    def spans(self) -> dict[str, tuple[int, int, int]]:
        """Return number of messages, and first and last time of logging [ns], of each topic that has some."""
        found: dict[str, tuple[int, int, int]] = {}
        for part in self.parts:
            for topic, (count, first, last) in part.spans().items():
                others = found.get(topic, (0, first, last))
                found[topic] = count + others[0], min(first, others[1]), max(last, others[2])
        return found

    def records(self, topics: set[str]) -> Iterator[tuple[str, int, int, bytes]]:
        """Yield topic, times at which it was logged and sent [ns], and data of each message of some topics."""
        for part in self.parts:
            yield from part.records(topics)


def _files_of(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    try:
        inside = sorted(path.iterdir())
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    files = [of for of in inside if of.suffix.lower() == SUFFIX]
    for suffix, what in OTHERS.items():
        if any(of.suffix.lower() == suffix for of in inside):
            raise InputError(f"{path}: is {what}, which is not read; {CONVERT}")
    if not files:
        raise InputError(f"{path}: is a directory without {SUFFIX} files, and so no bag of `ros2 bag record`")
    if logs := [of.name for of in files if is_log(of)]:
        raise InputError(f"{path}: is a directory of logs, and no bag of `ros2 bag record`; name one: {path / logs[0]}")
    return files


def _begin(part: LogFile) -> int:
    """Return when the first message was logged [ns]."""
    return min((first for _, first, _ in part.spans().values()), default=0)
