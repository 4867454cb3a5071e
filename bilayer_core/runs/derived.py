"""Derived messages of a log, such as markers and energies, held against those of the same run made again."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator

from bilayer_core.log.file.log_chunks import LogFile
from bilayer_core.log.messages.cdr import NANOSECONDS, nanoseconds, seconds_text
from bilayer_core.log.messages.clouds import CloudEncoder
from bilayer_core.log.messages.encoders import FrameEncoder, decode_input, encode_float64
from bilayer_core.log.messages.markers import deleting_all_first
from bilayer_core.log.messages.tf_frames import read_prefix
from bilayer_core.log.messages.topics import INPUTS, LOG_NAMESPACE, MARKERS, TF, Rate, stimulus_topics
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.observed.inputs import STIMULUS

Message = tuple[str, int, bytes]
"""Topic, log time [ns] and bytes."""
NOT_COMPARED = ("state", "solver")
"""Topics of frames that are not compared here: states are compared by value, and what the solver did is counted from
where a process began.
"""

NO_FRAME = "is there, but the run made again has no frame of that time"


class DerivedComparison:
    """Observer that compares stored messages byte by byte with those of the run made again, at their times.

    Every frame has all topics of `Rate.OUTPUT` that the log has. Topics of `Rate.DISPLAY` are in the log at a rate of
    their own: the messages that are there are compared. A message on the topic of a stimulus channel repeats an input.
    The frames up to the end of the first step are only compared at the start of a scene: a state that was taken from
    the log is evaluated anew, which may change the last bits of forces and energies that a step has left.

    Parameters
    ----------
    description : Description
    file : LogFile

    Attributes
    ----------
    topics : set of str
        Full names of the topics that are compared.
    count : int
        Messages that were compared.
    first : str
        The first difference, as a sentence; empty if there is none.
    """

    rate = math.inf

    def __init__(self, description: Description, file: LogFile):
        transforms = next(file.messages({TF.full_name()}), None)
        prefix = read_prefix(description, transforms[2]) if transforms else ""
        self._encoder = FrameEncoder(description, prefix or LOG_NAMESPACE.strip("/"))
        self._clouds = CloudEncoder(description)
        self._specs = {
            spec.full_name(): spec
            for spec in (*self._encoder.topics, *self._clouds.topics)
            if spec.full_name() in file.topics and spec.name not in NOT_COMPARED
        }
        self._in_every_frame = {topic for topic, spec in self._specs.items() if spec.rate is Rate.OUTPUT}
        channels = {spec.full_name() for spec in stimulus_topics(description)} & file.topics.keys()
        self.topics = channels | self._specs.keys()
        self.count, self.first = 0, ""
        self._loaded: int | None = None
        self._stamp = -1
        self._incomplete = ""
        self._frames = _by_frame(file.messages(set(self._specs)))
        self._next = next(self._frames, [])
        self._compare_stimuli(file.messages({INPUTS.full_name(), *channels}))

    @property
    def due(self) -> float:
        """Time of the next frame in the log [s]; infinity after the last, before a reset, and from the first difference
        on.
        """
        comes = self._next and self._next[0][1] > self._stamp and not self.first
        return self._next[0][1] / NANOSECONDS if comes else math.inf

    def start(self, description: Description) -> None:
        """Do nothing: the frames come by themselves."""

    def close(self, complete: bool, termination: str = "") -> None:
        """Do nothing; see `finish`."""

    def observe(self, frame: Frame) -> None:
        """Compare the messages of a frame, unless it is none of the log's."""
        self.first = self.first or self._incomplete
        stored, stamp = self._next, nanoseconds(frame.time)
        if self._loaded is None:
            self._loaded = frame.step
        if self.first or not stored or stamp < stored[0][1]:
            return
        self._next, self._stamp = next(self._frames, []), stamp
        loaded = 0 < self._loaded == frame.step
        display = any(self._specs[topic].rate is Rate.DISPLAY for topic, *_ in stored)
        clouds = dict(self._clouds.encode(frame)) if display else {}
        for topic, time, data in stored:
            if time != stamp:
                self._differs(topic, time, NO_FRAME)
            elif not loaded:
                self._compare_encoded(topic, time, data, frame, clouds)
        for topic in sorted(self._in_every_frame - {topic for topic, *_ in stored}):
            self._incomplete = self._incomplete or _at(topic, stamp, "is missing")

    def finish(self, whole: bool) -> None:
        """Notice what is missing or too many at the end; a log that is not whole has frames after its last state, and
        the last may be a part.
        """
        if whole:
            self.first = self.first or self._incomplete
            for topic, time, _ in self._next:
                self._differs(topic, time, NO_FRAME)

    def _compare_stimuli(self, messages: Iterable[Message]) -> None:
        expected: deque[Message] = deque()
        for topic, time, data in messages:
            if topic != INPUTS.full_name():
                self._compare(topic, time, (topic, time, data), expected.popleft() if expected else None)
            elif (told := decode_input(data)).kind == STIMULUS:
                expected.append((f"{LOG_NAMESPACE}/stimulus/{told.name}", time, encode_float64(told.values[0])))
        for topic, time, _ in expected:
            self._differs(topic, time, "is missing")

    def _compare_encoded(self, topic: str, time: int, data: bytes, frame: Frame, clouds: dict[str, bytes]) -> None:
        spec = self._specs[topic]
        again = clouds.get(spec.name) if spec in self._clouds.topics else self._encoder.encode(spec.name, frame)
        if spec.name == MARKERS and len(data) > len(again):  # the first of a log
            again = deleting_all_first(again)
        self._compare(topic, time, data, again)

    def _compare(self, topic: str, time: int, stored: object, again: object) -> None:
        self.count += 1
        if stored != again:
            self._differs(topic, time, "is not what the run made again gives")

    def _differs(self, topic: str, time: int, how: str) -> None:
        self.first = self.first or _at(topic, time, how)


def _at(topic: str, time: int, how: str) -> str:
    return f"t = {seconds_text(time)} s: the message of {topic} {how}"


def _by_frame(messages: Iterable[Message]) -> Iterator[list[Message]]:
    """Yield the messages of each frame: those of one time that follow each other, of different topics."""
    frame: list[Message] = []
    for message in messages:
        if frame and (message[1] != frame[0][1] or message[0] in {topic for topic, *_ in frame}):
            yield frame
            frame = []
        frame.append(message)
    if frame:
        yield frame
