"""The MCAP log: an observer that writes every frame in a thread of its own.

A log holds the topics of `log.messages.topics` as ROS 2 messages (profile ``ros2``), the scene as attachment
``scene.yaml``, and the metadata records ``versions``, ``machine``, ``settings`` and ``description`` (before the first
message), ``chain`` (after each chunk, see `log.file.chain`) and ``run`` (``complete``, ``termination``, ``last_time``
and the end of the chain; written at the end, so a log without it was cut off).
"""

from __future__ import annotations

import math
import os
import sys
import threading
import time as clock
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

from bilayer_core.errors import InputError, OutputError, SimulationError
from bilayer_core.jit.library import origin
from bilayer_core.log.file.backlog import Backlog
from bilayer_core.log.file.chain import CHAIN, END, Chain, place_in_state
from bilayer_core.log.file.lock import open_alone, refuse_file_in_use
from bilayer_core.log.file.log_head import SCENE_ATTACHMENT
from bilayer_core.log.file.output_paths import check_output_path, unwritable
from bilayer_core.log.messages.cdr import nanoseconds
from bilayer_core.log.messages.clouds import CloudEncoder
from bilayer_core.log.messages.description_text import to_text
from bilayer_core.log.messages.encoders import FrameEncoder, encode_float64, encode_input
from bilayer_core.log.messages.event_messages import encode_event
from bilayer_core.log.messages.events import Event, EventDetector
from bilayer_core.log.messages.markers import deleting_all_first
from bilayer_core.log.messages.schemas import schema_text
from bilayer_core.log.messages.topics import EVENTS, INPUTS, MARKERS, QOS, DisplayGate, Rate, TopicSpec, input_topics
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.observed.inputs import STIMULUS, Input

CHUNK_SIZE = 256 * 1024  # [bytes]: 0.9 ms to compress; larger chunks stall the thread and lose more in a crash
GATHERING_PERIOD = 0.1  # for which the writer lets frames gather, so that it wakes ten times a second [s of wall time]
FLUSH_PERIOD = 0.4  # longest time that a message then waits for its chunk to be written [s of wall time]
SYNC_PERIOD = 1.0  # longest time before it is on the disk [s of wall time]
MESSAGE_SIZE = 31  # of a message beside its data [bytes]
QUEUE_LENGTH = 64  # frames waiting for the writer; some megabytes
LONGEST_SILENCE = 10.0  # after which a log with a patience is given up at its end [s of wall time]
SUFFIX = ".mcap"
STATE_NAME = "state"


class McapRecorder:
    """Observer that writes an MCAP log; importing this module does not import mcap.

    What was handed over more than about a second ago survives a crash of the process or of the machine.

    Parameters
    ----------
    path : str or Path
        File to write.
    rate : float
        Observations per simulated second [Hz].
    marker_rate : float
        Rate of the large messages made to be looked at (`Rate.DISPLAY`) [Hz].
    force : bool
        Replace an existing file.
    patience : float, optional
        Longest time for which a disk that is 64 frames behind holds the run up [s]. Without one `observe` waits as long
        as it takes, nothing is lost, and a disk that fails is an error of the run. With one, 0 included, the disk never
        ends the run: whole frames are left out and counted, but no input and not the last frame. What failed is in
        `failure`, and `close` raises it.
    tf : str
        What names of frames on ``/tf`` begin with (`log.messages.tf_frames`); empty: the log has no such topic.

    Attributes
    ----------
    dropped : int
        Frames that were left out so far.

    Raises
    ------
    InputError
        At once, before any simulation: the name does not end in ``.mcap``, the directory is missing or not writable,
        the file exists, or with `force` another program is writing it.
    """

    def __init__(
        self,
        path: str | Path,
        rate: float = 50.0,
        marker_rate: float = 20.0,
        force: bool = False,
        patience: float | None = None,
        tf: str = "",
    ):
        self.path = check_output_path(path, force, SUFFIX)
        refuse_file_in_use(self.path)
        self.rate = rate
        self.dropped = 0
        self._gate = DisplayGate(rate, marker_rate)
        self._force, self._patience, self._tf = force, patience, tf
        self._last_time = 0.0
        self._left_out: Frame | None = None
        self._backlog: Backlog[Frame | Input | Event | dict[str, str]] = Backlog(QUEUE_LENGTH, GATHERING_PERIOD)
        self._thread: threading.Thread | None = None
        self._written = 0
        self._failure: Exception | None = None
        self._kept = ""

    @property
    def failure(self) -> str:
        """Why the log could not be written further; empty as long as it can."""
        return str(self._failure_of_run() or "")

    def start(self, description: Description) -> None:
        """Open the file; write scene and settings, and flush them.

        Parameters
        ----------
        description : Description
            The constant part of the run.

        Raises
        ------
        InputError
            If another program has begun to write the file.
        OutputError
            If it cannot be written; nothing is left then.
        """
        try:
            log = _LogFile(self.path, self._force, description, self._gate, self._tf)
        except OSError as error:
            raise unwritable(self.path, error) from error
        # A daemon, so that a program that ends without `close` is not kept alive; its log is then cut off.
        self._thread = threading.Thread(target=self._write, args=(log,), name="mcap log", daemon=True)
        self._thread.start()

    def observe(self, frame: Frame) -> None:
        """Give a frame to the writer, as `patience` says.

        Parameters
        ----------
        frame : Frame

        Raises
        ------
        SimulationError
            If writing failed before, and there is no patience.
        """
        self._refuse_unstarted()
        if self._patience is None:
            self._put(frame)
        elif not self._put_in_time(frame):
            self.dropped += 1
            self._left_out = frame
            return
        self._left_out, self._last_time = None, frame.time

    @property
    def waiting(self) -> int:
        """Frames, inputs and events that are not written yet."""
        return len(self._backlog)

    def set_rates(self, rate: float, marker_rate: float) -> None:
        """Continue with frames, and with the large messages, at other rates.

        Parameters
        ----------
        rate, marker_rate : float
            Rate of frames, and of the large messages [Hz].
        """
        self.rate = rate
        self._gate.set_rates(rate, marker_rate)

    def note(self, told: Input) -> None:
        """Log an input from outside; like a frame, but it is never left out.

        Parameters
        ----------
        told : Input
        """
        self._keep(told)

    def _put_in_time(self, frame: Frame) -> bool:
        """Wait no more for a disk for which one wait was in vain, until it has caught up."""
        return self._failure is None and self._backlog.put(frame, self._patience if self._left_out is None else 0.0)

    def tell(self, event: Event) -> None:
        """Log an event that frames do not show; it is not left out either.

        Parameters
        ----------
        event : Event
        """
        self._keep(event)

    def _keep(self, item: Input | Event) -> None:
        """Put what is never left out into the backlog."""
        self._refuse_unstarted()
        if self._patience is None:
            self._put(item)
        elif self._failure is None:
            self._backlog.add(item)

    def close(self, complete: bool, termination: str = "") -> None:
        """Write what is left and finish the file.

        Parameters
        ----------
        complete : bool
            Whether the run reached its end.
        termination : str
            Why it ended, for `read_info`; by default ``"completed"`` or ``"stopped"``.

        Raises
        ------
        SimulationError
            If anything could not be written; with a patience, OutputError.
        """
        if self._thread is None:
            return
        if self._left_out is not None and self._failure is None:
            self._backlog.add(self._left_out)
            self._last_time = self._left_out.time
            self.dropped -= 1
        ending = {
            "complete": "true" if complete else "false",
            "termination": termination or ("completed" if complete else "stopped"),
            "last_time": repr(float(self._last_time)),
            **({"dropped_frames": str(self.dropped)} if self.dropped else {}),
        }
        self._backlog.add(ending, urgent=True)
        try:
            self._join(self._thread)
        finally:
            self._thread = None
        if isinstance(self._failure, OSError) and not self._kept:
            self._kept = f"; {self._what_is_kept()}"
        self._raise_failure()

    def _join(self, thread: threading.Thread) -> None:
        """Wait for the writer; with a patience it is given up once it has written nothing for long."""
        written = -1
        while thread.is_alive():
            if self._patience is not None and written == self._written:
                text = f"the log {self.path} could not be finished: nothing of it was taken in {LONGEST_SILENCE:g} s"
                self._failure = OutputError(text)
                return
            written = self._written
            thread.join(None if self._patience is None else LONGEST_SILENCE)

    def _refuse_unstarted(self) -> None:
        if self._thread is None and self._failure is None:
            raise RuntimeError("the recorder has not been started, or is closed")

    def _put(self, item: Frame | Input | Event) -> None:
        self._raise_failure()
        if not self._backlog.put(item):
            self._raise_failure()

    def _raise_failure(self) -> None:
        failure = self._failure_of_run()
        if failure is not None:
            raise failure from (None if failure is self._failure else self._failure)

    def _failure_of_run(self) -> Exception | None:
        """Return the exception that `close` raises as things stand; None if it raises none."""
        if not isinstance(self._failure, OSError):
            return self._failure
        reason = f"the log {self.path} could not be written: {self._failure.strerror or self._failure}{self._kept}"
        return SimulationError(reason, self._last_time) if self._patience is None else OutputError(reason)

    def _what_is_kept(self) -> str:
        """Return what is kept after a failure, as who reads the file will find it."""
        from bilayer_core.log.run.log_reader import read_info

        if not self.path.is_file():
            return "nothing of it is kept"
        try:
            info = read_info(self.path)
        except InputError as error:
            return f"what is kept cannot be read ({error})"
        if not any(topic["count"] for topic in info.topics.values()):
            return "it holds no frame"
        return f"it can be read up to t = {info.last_time:.6g} s ({info.size / 1e6:.3g} MB)"

    def _write(self, log: _LogFile) -> None:
        """Write until the ending comes or something fails; the other thread then raises the failure.

        The writer's thread runs this.
        """
        failure = None
        for work in (lambda: self._write_all(log), log.close):
            try:
                work()
            except Exception as error:
                failure = failure or error  # what fails after that, such as to close the file, follows from it
        if failure is not None:
            if self._patience is None:  # else at the end: to read a long log takes what a run that goes on needs
                self._kept = f"; {self._what_is_kept()}"
            self._failure = self._failure or failure
        self._backlog.close()

    def _write_all(self, log: _LogFile) -> None:
        while True:
            for item in self._backlog.take(log.time_to_flush()):
                if isinstance(item, dict):
                    log.finish(item)
                    return
                log.write(item)
                self._written += 1
            if log.time_to_flush() == 0.0:
                log.flush()
                self._written += 1


class _LogFile:
    """The file itself, used by one thread at a time."""

    def __init__(self, path: Path, force: bool, description: Description, gate: DisplayGate, tf: str):
        import mcap
        from mcap.writer import CompressionType, Writer

        from bilayer_core.observed.system import machine, versions

        self._gate = gate
        self._encoder = FrameEncoder(description, tf)
        self._clouds = CloudEncoder(description)
        self._events = EventDetector(description)
        self._file = open_alone(path, force)
        self._names = {
            shown: [
                spec.name
                for spec in self._encoder.topics
                if spec.name != STATE_NAME and (shown or spec.rate is not Rate.DISPLAY)
            ]
            for shown in (False, True)
        }
        self._has_markers, self._state_time = False, math.nan
        self._in_chunk = self._sequence = 0
        self._unflushed_since: float | None = None
        self._synced = clock.monotonic()
        with ExitStack() as undo:
            undo.callback(self._file.close)
            undo.callback(_delete, path)
            used = {**versions(), "mcap": mcap.__version__}
            library = f"bilayer_sim_ros {used['bilayer_sim_ros']}"
            self._log = Writer(self._file, sys.maxsize, CompressionType.LZ4)  # chunks end here, see `_end_chunk`
            self._log.start("ros2", library)
            self._log.add_attachment(0, 0, SCENE_ATTACHMENT, "application/yaml", description.scene_text.encode())
            head = {
                "versions": used,
                "machine": machine() | origin(),
                "settings": {key: text for key, text in description.settings.items() if key not in used},
                "description": to_text(description),
            }
            for name, metadata in head.items():
                self._log.add_metadata(name, metadata)
            self._chain, self._seal = Chain(description.scene_text, head), place_in_state(description, "seal")
            self._time = place_in_state(description, "time")
            self._add_link()
            topics = (*self._encoder.topics, *self._clouds.topics, *input_topics(description))
            self._topics = self._announce(topics)
            self._log.flush()
            self._sync()
            undo.pop_all()

    def _announce(self, topics: Iterable[TopicSpec]) -> dict[str, int]:
        """Announce topics and their types, outside of chunks, too: if the first one is lost, what follows can be read.

        Returns their numbers by name.
        """
        from mcap.data_stream import RecordBuilder
        from mcap.records import Channel, Schema

        records = RecordBuilder()
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for spec in topics:
            if spec.type not in schemas:
                said = {"name": spec.type, "encoding": "ros2msg", "data": schema_text(spec.type).encode()}
                schemas[spec.type] = self._log.register_schema(**said)
                Schema(id=schemas[spec.type], **said).write(records)
            told = {
                "topic": spec.full_name(),
                "message_encoding": "cdr",
                "schema_id": schemas[spec.type],
                "metadata": {QOS: spec.offered_profile},
            }
            channels[spec.name] = self._log.register_channel(**told)
            Channel(id=channels[spec.name], **told).write(records)
        self._file.write(records.end())
        return channels

    def write(self, item: Frame | Input | Event) -> None:
        """Write the messages of a frame, of what acts from outside, or of an event."""
        if isinstance(item, Input):
            stamp, data = nanoseconds(item.time), encode_input(item)
            self._chain.add_input(stamp, data)
            self._add(INPUTS.name, stamp, data)
            if item.kind == STIMULUS:
                self._add(f"stimulus/{item.name}", stamp, encode_float64(item.values[0]))
        elif isinstance(item, Event):
            self._add_events([item])
        else:
            self._write_frame(item)
            self._add_events(self._events.see(item))
            self._sequence += 1
        if self._unflushed_since is None:
            self._unflushed_since = clock.monotonic()

    def _write_frame(self, frame: Frame) -> None:
        self._write_state(frame)
        stamp, display = nanoseconds(frame.time), self._gate.is_due(frame.time)
        for name in self._names[display]:
            data = self._encoder.encode(name, frame)
            if name == MARKERS and not self._has_markers:
                self._has_markers, data = True, deleting_all_first(data)
            self._add(name, stamp, data)
        for name, data in self._clouds.encode(frame) if display else ():
            self._add(name, stamp, data)

    def _write_state(self, frame: Frame) -> None:
        """Write the state of the last step before a frame at its own time, once for all frames of the next one."""
        time = frame.time if self._time is None else float(frame.state[self._time])
        if time == self._state_time:
            return
        self._state_time, stamp = time, nanoseconds(time)
        self._chain.add_state(stamp, 0.0 if self._seal is None else frame.state[self._seal])
        self._add(STATE_NAME, stamp, self._encoder.encode(STATE_NAME, frame))

    def _add_events(self, events: list[Event]) -> None:
        for event in events:
            self._add(EVENTS.name, nanoseconds(event.time), encode_event(event))

    def _add(self, name: str, stamp: int, data: bytes) -> None:
        self._log.add_message(self._topics[name], stamp, data, stamp, self._sequence)
        self._in_chunk += MESSAGE_SIZE + len(data)
        if self._in_chunk > CHUNK_SIZE:
            self._end_chunk()

    def _end_chunk(self) -> None:
        """Write the chunk in hand, and the hash of what it holds."""
        self._log.flush()
        if self._in_chunk:
            self._add_link()
        self._in_chunk = 0

    def _add_link(self) -> None:
        """Write the hash of the states and inputs in the chunks so far."""
        self._log.add_metadata(CHAIN, self._chain.link.as_metadata())

    def time_to_flush(self) -> float | None:
        """Return the wall time until `flush` is due [s], None if there is nothing to flush."""
        if self._unflushed_since is None:
            return None
        return max(0.0, self._unflushed_since + FLUSH_PERIOD - clock.monotonic())

    def flush(self) -> None:
        """Write the chunk in hand; every second also to the disk."""
        self._end_chunk()
        self._file.flush()
        self._unflushed_since = None
        if clock.monotonic() - self._synced >= SYNC_PERIOD - FLUSH_PERIOD - GATHERING_PERIOD:
            self._sync()

    def _sync(self) -> None:
        os.fsync(self._file.fileno())
        self._synced = clock.monotonic()
        if os.fstat(self._file.fileno()).st_nlink == 0:
            raise OSError(None, "the file was deleted while it was written")

    def finish(self, ending: dict[str, str]) -> None:
        """Write the metadata ``run`` and the file's index."""
        self._add_events(self._events.end(float(ending["last_time"])))
        self._end_chunk()
        self._log.add_metadata(END, ending | self._chain.link.as_metadata())
        self._log.finish()
        self._file.flush()
        self._sync()

    def close(self) -> None:
        """Close the file as it is."""
        self._file.close()


def _delete(path: Path) -> None:
    """Delete a file, but no device or pipe."""
    if path.is_file():
        path.unlink()
