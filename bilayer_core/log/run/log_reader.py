"""Reading logs, whole or cut off by a crash, with numpy alone.

A cut-off log is read up to its last whole record; the chunk that was being written when the process died is lost.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.file.chain import END, STATE, Link
from bilayer_core.log.file.log_chunks import LogFile
from bilayer_core.log.file.log_head import Head, read_head
from bilayer_core.log.file.log_opening import metadata_records
from bilayer_core.log.messages.cdr import NANOSECONDS, decoded, nanoseconds, read_float64_multi_array
from bilayer_core.log.messages.topics import INPUTS
from bilayer_core.log.run.bag import Bag, BagRun, choose_run, split_address
from bilayer_core.log.run.log_source import LogSource
from bilayer_core.log.run.logged_run import LoggedRun
from bilayer_core.log.run.opened_run import names_log
from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.frame import Description

__all__ = [
    "CUT_OFF",
    "Head",
    "LogInfo",
    "read_description",
    "read_head",
    "read_info",
    "read_log",
    "read_messages",
    "read_state",
    "scene_from_log",
]

CUT_OFF = "cut off"
REPAIRED = "repair"
"""Metadata record of a log that `repair` has made: what it kept and lost."""
LATE = (END, REPAIRED)
"""Metadata records that stand after the messages."""
READ_BAGS = ("view", "render", "plot", "export", "compare")
"""Verbs that read bags too."""
FIRST_DATE = 946_684_800 * NANOSECONDS
"""Of the year 2000: messages that were logged before have no date, but a time of simulation [ns]."""


@dataclass(frozen=True)
class LogInfo:
    """Contents of a log, a bag or another file: the output of `bilayer info` (`dataclasses.asdict` gives its JSON).

    Attributes
    ----------
    path, scene, title : str
        Scene and title are empty where the file does not say.
    versions, settings : dict
    start_time, last_time, duration : float
        Simulated time of the first and last message, and between them [s]; of a bag, if it holds one run.
    channels : tuple of str
        Stimulus channels.
    topics : dict
        Topic -> {"type": ROS type, "count": messages}.
    complete : bool
        Whether the run reached its end and the file was finished.
    termination : str
        Why it ended; ``"cut off"`` for a file without an end.
    size : int
        Of the file [bytes].
    lacks : tuple of str
        What a log of this version holds and this one does not, and what cannot be done without.
    kind : str
        ``"log"``; ``"bag"``, which a recorder made of the messages of nodes; ``"mcap"`` without any such messages.
    runs : tuple of BagRun
        Of a bag.
    recorded : tuple of str
        When the first and the last message of a bag were recorded, in UTC; empty where it does not say.
    commands : tuple of str
        Verbs of `bilayer` that can read the file beside ``info``.
    """

    path: str
    scene: str
    title: str
    versions: dict[str, str]
    settings: dict[str, str]
    start_time: float
    last_time: float
    duration: float
    channels: tuple[str, ...]
    topics: dict[str, dict]
    complete: bool
    termination: str
    size: int
    lacks: tuple[str, ...] = ()
    kind: str = "log"
    runs: tuple[BagRun, ...] = ()
    recorded: tuple[str, ...] = ()
    commands: tuple[str, ...] = (*READ_BAGS, "replay", "repair", "run --from-state")


def read_info(path: str | Path) -> LogInfo:
    """Return the contents of a log, a bag or any other MCAP file.

    Those of a log come from its index or, if it was cut off, from reading it through; a bag and any other file are read
    through once. Raises InputError if it is no MCAP file, or is damaged.
    """
    path, node, number = split_address(path)
    if not names_log(path, node, number):
        return _info_of_bag(Bag(path, node), number)
    head, file = read_head(path), LogFile(path)
    spans = file.spans()
    metadata = _read_metadata(path)
    ending = metadata.get(END, {})
    start, last = (time / NANOSECONDS for time in _span(spans))
    return LogInfo(
        path=str(path),
        scene=head.description.scene_name,
        title=head.description.title,
        versions=head.versions,
        settings=head.settings,
        start_time=start,
        last_time=last,
        duration=last - start,
        channels=head.description.channels,
        topics=_counts(file.topics, spans),
        complete=ending.get("complete") == "true",
        termination=ending.get("termination", CUT_OFF),
        size=path.stat().st_size,
        lacks=_lacks(head, file, metadata),
    )


def _info_of_bag(bag: Bag, number: int) -> LogInfo:
    """Return the contents of a file that is not a log of ours."""
    files = bag.files
    spans = files.spans()
    runs = tuple(run for run in bag.runs if number in (0, run.number))
    if not runs and (bag.node or number):
        choose_run(bag, number)  # says which there are
    lacks, source = [bag.problem] if bag.problem else [], None
    if len(runs) == 1:
        try:
            source = LogSource(f"{files.path}{runs[0].address}", *bag.opened(runs[0]))
            lacks += [f"{topic}: its quantities are not there" for topic in source.lacks]
        except InputError as error:
            lacks.append(str(error))
    lacks += [f"{part.path}: an index, as it was not finished" for part in files.parts if not part.has_index]
    uncertain = "messages, and when the others were sent: energy, solver and stimulus_applied may be some frames off"
    lacks += [f"{run.node}: {uncertain}" for run in runs if not run.certain]
    lacks += [f"{run.node}: stamps; times are those since its first message" for run in runs if not run.stamped]
    return LogInfo(
        path=str(files.path),
        scene=source.description.scene_name if source else "",
        title=source.description.title if source else "",
        versions={},
        settings=source.description.settings if source else {},
        start_time=runs[0].start_time if len(runs) == 1 else 0.0,
        last_time=runs[0].last_time if len(runs) == 1 else 0.0,
        duration=runs[0].last_time - runs[0].start_time if len(runs) == 1 else 0.0,
        channels=source.description.channels if source else (),
        topics=_counts(files.topics, spans),
        complete=False,
        termination="",
        size=sum(part.path.stat().st_size for part in files.parts),
        lacks=tuple(lacks),
        kind="bag" if bag.runs else "mcap",
        runs=runs,
        recorded=tuple(map(_date, _span(spans))) if _span(spans)[0] >= FIRST_DATE else (),
        commands=READ_BAGS if bag.runs else (),
    )


def _counts(topics: dict[str, str], spans: dict[str, tuple[int, int, int]]) -> dict[str, dict]:
    """Return the type and number of messages of each topic, in the order of their names."""
    return {topic: {"type": topics[topic], "count": spans.get(topic, (0,))[0]} for topic in sorted(topics)}


def _span(spans: dict[str, tuple[int, int, int]]) -> tuple[int, int]:
    """Return the times of the first and the last message [ns]; zeros if there are none."""
    times = [time for _, first, last in spans.values() for time in (first, last)] or [0]
    return min(times), max(times)


def _date(time: int) -> str:
    return datetime.fromtimestamp(time // NANOSECONDS, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def read_description(path: str | Path) -> Description:
    """Return the description that the log was written with."""
    return read_head(Path(path)).description


def scene_from_log(path: str | Path) -> str:
    """Return YAML text of the scene that was run, overrides included."""
    return read_description(path).scene_text


def read_state(path: str | Path, time: float | None = None) -> tuple[np.ndarray, float]:
    """Return the flat state and its time [s]: the last one logged, or the last one at or before `time`.

    An InputError if there is none, or if `time` is later than the last one by more than states are apart.
    """
    file = LogFile(path)
    stamps = file.times(STATE)
    if time is not None:
        latest = np.sort(stamps)[-2:].tolist()
        if latest and nanoseconds(time) > 2 * latest[-1] - latest[0]:
            last = latest[-1] / NANOSECONDS
            raise InputError(f"{path}: its last state is of t = {last:.9g} s, and t = {time:g} s is after its end")
        stamps = stamps[stamps <= max(0, nanoseconds(time))] if time >= 0.0 else stamps[:0]
    if not len(stamps):
        before = "" if time is None else f" at or before t = {time:g} s"
        raise InputError(f"{path}: holds no state{before}")
    last, found = int(stamps.max()), None
    for _, stamp, data in file.messages({STATE}, begin=last):
        if stamp > last:
            break
        found = data if stamp == last else found
    if found is None:
        raise InputError(
            f"{path}: is damaged: its index has a state at t = {last / NANOSECONDS:.9g} s, its chunks none"
        )
    values = decoded(path, STATE, last, found, read_float64_multi_array)[1]
    return values.copy(), last / NANOSECONDS


def read_log(path: str | Path) -> RunData:
    """Return a run as arrays over time, which are read on demand.

    ``run["com"]`` reads that quantity alone, so it works on logs larger than the memory. Attributes such as
    ``run.positions`` read all values that come at one rate. Times are those at which the log has all topics of a rate:
    a log that was cut off, or repaired, may hold parts of a frame.

    Parameters
    ----------
    path : str or Path
        A log, or a bag of ``ros2 bag record`` (`opened_run.open_run` says how the runs in a bag are named).

    Returns
    -------
    RunData
        The run; time is the first axis of its arrays.

    Raises
    ------
    InputError
        If the file is no log; at the first use of a quantity, if its data are damaged, or the log does not hold it.
    """
    return LoggedRun(LogSource(path))


def read_messages(path: str | Path, topics: set[str] | None = None) -> Iterator[tuple[str, str, int, bytes | None]]:
    """Yield the topic, ROS type, time [ns] and data of each message of `topics` (default all), in the order of the
    file.

    Each topic is announced first with the data None, even if no message follows.
    """
    file = LogFile(path)
    for topic, ros_type in file.topics.items():
        if topics is None or topic in topics:
            yield topic, ros_type, 0, None
    for topic, time, data in file.messages(topics):
        yield topic, file.topics[topic], time, data


def _read_metadata(path: Path) -> dict[str, dict[str, str]]:
    """Return the metadata records by name that stand after the messages."""
    return dict(metadata_records(path, LATE))


def _lacks(head: Head, file: LogFile, metadata: dict[str, dict[str, str]]) -> tuple[str, ...]:
    """Return the parts that a log lacks because it is older or unfinished, or because other tools took them out."""
    lacks = []
    if INPUTS.full_name() not in file.topics:
        lacks.append(f"{INPUTS.full_name()}, what acted on the run: it cannot be replayed")
    if STATE not in file.topics:
        lacks.append(f"{STATE}: no run can go on from it")
    if not head.machine:
        lacks.append("the machine it was made on: a replay cannot tell whether this is another one")
    for topic in LogSource(file.path, head, file).lacks:
        lacks.append(f"{topic}: its quantities are not there")
    if not all(channel.metadata for channel in file.channels.values()):
        lacks.append("the quality of service of its topics: rosbag2 plays them with its own")
    if not file.has_index:
        lacks.append("an index, as it was not finished: `bilayer repair` makes a log with one of it")
    if dropped := metadata.get(END, {}).get("dropped_frames"):
        lacks.append(f"{dropped} frames, left out while the disk was behind; no input is missing")
    if end := Link.of(metadata.get(END, {})):
        for what, count, topic in (("states", end.states, STATE), ("inputs", end.inputs, INPUTS.full_name())):
            if missing := count - len(file.times(topic)):
                lacks.append(f"{missing} {what}, which were taken out of it or lost")
    if lost := metadata.get(REPAIRED, {}).get("lost"):
        lacks.append(f"what was lost before it was repaired: {lost}")
    return tuple(lacks)
