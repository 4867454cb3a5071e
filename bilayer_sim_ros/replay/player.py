"""Plays the messages of a log by their time, in a thread of its own, which seeks, waits and goes on as it is asked."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from bilayer_core.errors import InputError
from bilayer_core.log.file.indexed_log import IndexedLog, Message
from bilayer_core.log.messages.cdr import nanoseconds, seconds_text
from bilayer_sim_ros.replay.log_clock import LogClock
from bilayer_sim_ros.services.requests import Requests

LARGEST_LAG = 0.1
"""Messages that are later than this are not hurried after: time goes on from where they are [s of real time]."""
SHOWING_PERIOD = 1.0
"""Between two times at which it is told where playing is [s of real time]."""
SHORTEST_LOOP = nanoseconds(1e-3)
"""Log time that can be played over and over [ns]."""


class Outlet(Protocol):
    """Where messages go."""

    channels: Collection[int]  # Of the log, those that are played
    latched: Mapping[int, int]  # Channel -> how many of its last messages those get who come late (transient local)

    def restart(self) -> None:
        """Take note that messages of another time follow: at the start, after a seek, and when a loop begins again."""

    def send(self, message: Message) -> None:
        """Publish a message."""

    def finish_instant(self) -> None:
        """Take note that all messages of one time have been sent."""

    def forget(self, channel: int) -> None:
        """Delete what was published on a latched channel until now, so that nobody gets it."""

    def send_clock(self, now: int) -> None:
        """Publish the time of the log [ns]."""

    def flush(self) -> None:
        """Wait a little until all that was sent has arrived."""


@dataclass(frozen=True)
class Playback:
    """Part of a log to play, and how to play it."""

    begin: int
    end: int
    """`begin`, `end`: times of the log between which it is played, both included [ns]."""
    first: int  # Where the first pass begins [ns]
    rate: float = 1.0  # Seconds of the log per second
    loop: bool = False  # Whether to begin again at the end
    paused: bool = False  # Whether to wait for `Player.resume` at the start
    clock_rate: float = 0.0  # Clock messages per second of real time [Hz]; 0 = none
    clock_on_publish: bool = False  # Whether a clock message with its time goes out right before each message
    stored_clock: bool = False  # Whether the clock messages in the log are played


class Player:
    """Plays a log.

    `pause`, `resume` and the like may be called by any thread; the future that they return says what was done, or has
    an InputError that says why it was not.

    Parameters
    ----------
    log : IndexedLog
        Read by the player's thread alone, once it is started.
    outlet : Outlet
        Likewise called by that thread alone.
    playback : Playback
    moved : callable
        Called with the time of the log [ns] about once a second and after each request, in the player's thread.
    behind : callable
        Called with how much later than the rate asks messages have become in all [s], when that grows.
    finished : callable
        Called at the very end, in the player's thread.
    """

    def __init__(
        self,
        log: IndexedLog,
        outlet: Outlet,
        playback: Playback,
        *,
        moved: Callable[[int], None] = lambda _: None,
        behind: Callable[[float], None] = lambda _: None,
        finished: Callable[[], None] = lambda: None,
    ):
        if playback.loop and playback.end - playback.begin < SHORTEST_LOOP:
            raise InputError(
                f"{log.path}: what is to be played in a loop takes {(playback.end - playback.begin) / 1e9:g} s of the "
                f"log; at least {SHORTEST_LOOP / 1e9:g} s are needed"
            )
        self._log = log
        self._topics = {channel.number: channel.topic for channel in log.channels}
        self._outlet = outlet
        self._playback = playback
        self._moved, self._behind, self._finished = moved, behind, finished
        self._clock = LogClock(playback.rate)
        self._clock.jump(playback.first)
        self._held: dict[int, list[int]] = {channel: [] for channel in outlet.latched}
        self._requests = Requests("playing has ended")
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._work, name="player")
        self.error: Exception | None = None  # Why playing ended, unless it was stopped or reached the end
        self.lag = 0.0  # How much later than the rate asks messages have become in all [s of real time]

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End, and return when that is done."""
        self._stopping.set()
        self._requests.wake()
        self._thread.join()

    @property
    def paused(self) -> bool:
        """True if time stands still."""
        return not self._clock.running

    @property
    def rate(self) -> float:
        """Seconds of the log per second."""
        return self._clock.rate

    @property
    def position(self) -> int:
        """Time of the log [ns]."""
        return min(self._clock.now, self._playback.end)

    def pause(self) -> Future:
        """Ask to stand still; the result is a text."""
        return self._requests.ask(self._answering(self._do_pause))

    def resume(self) -> Future:
        """Ask to go on; the result is a text."""
        return self._requests.ask(self._answering(self._do_resume))

    def toggle_paused(self) -> Future:
        """Ask to stand still or to go on, whichever it does not do; the result is a text."""
        return self._requests.ask(self._answering(lambda: self._do_resume() if self.paused else self._do_pause()))

    def is_paused(self) -> Future:
        """Ask whether it stands still; the result is that, and a text."""
        return self._requests.ask(self._answering(lambda: (self.paused, self._state())))

    def play_next(self) -> Future:
        """Ask for the next message, while paused; the result is a text."""
        return self._requests.ask(self._answering(self._do_play_next))

    def burst(self, count: int) -> Future:
        """Ask for the next `count` messages at once, while paused (0: all); the result is how many there were."""
        return self._requests.ask(self._answering(partial(self._do_burst, count)))

    def seek(self, position: int) -> Future:
        """Ask to go to a time of the log [ns]; what is paused stays so. The result is a text."""
        return self._requests.ask(self._answering(partial(self._do_seek, position)))

    def set_rate(self, rate: float) -> Future:
        """Ask for another rate; the result is a text."""
        return self._requests.ask(self._answering(partial(self._do_set_rate, rate)))

    def end(self) -> Future:
        """Ask to play nothing more and end; the result is a text."""
        return self._requests.ask(self._answering(self._do_end))

    # The rest runs in the player's thread.

    def _work(self) -> None:
        try:
            self._go_to(self._playback.first)
            self._clock_due = self._shown_at = time.monotonic()
            if not self._playback.paused:
                self._clock.start()
            while not self._stopping.is_set():
                self._requests.serve(self._time_to_wait())
                if not self._stopping.is_set():
                    self._play_what_is_due()
            self._outlet.flush()
        except Exception as error:
            self.error = error
        finally:
            self._requests.close()
            self._finished()

    def _time_to_wait(self) -> float:
        """Return the time until something has to be done without a request [s]."""
        now = time.monotonic()
        wait = self._shown_at + SHOWING_PERIOD - now
        if self._playback.clock_rate > 0.0:
            wait = min(wait, self._clock_due - now)
        if self._clock.running:
            wait = min(wait, self._clock.until(self._next.time if self._next else self._playback.end))
        return max(wait, 0.0)

    def _play_what_is_due(self) -> None:
        now = time.monotonic()
        if self._playback.clock_rate > 0.0 and now >= self._clock_due:
            self._send_clock()
            period = 1.0 / self._playback.clock_rate
            self._clock_due = max(self._clock_due + period, now)
        if now >= self._shown_at + SHOWING_PERIOD:
            self._show()
        if not self._clock.running:
            return
        if self._next is None:
            if self._clock.until(self._playback.end) <= 0.0:
                self._end_pass()
            return
        late = -self._clock.until(self._next.time)
        if late >= 0.0:
            if late > LARGEST_LAG:
                self._clock.jump(self._next.time)
                self.lag += late
                self._behind(self.lag)
            self._send_next()

    def _end_pass(self) -> None:
        """Start the next pass, or stop, at the end of what is to be played."""
        if self._playback.loop:
            self._go_to(self._playback.begin)
        else:
            self._clock.jump(self._playback.end)
            self._stopping.set()

    def _send_next(self) -> Message:
        """Send the message whose turn it is, and read the following one, so that it is there when it is due."""
        sent = self._next
        if self._playback.clock_on_publish:
            self._outlet.send_clock(sent.time)
        self._send(sent)
        self._next = self._following(self._messages)
        if self._next is None or self._next.time != sent.time:
            self._outlet.finish_instant()
        return sent

    def _send(self, message: Message) -> None:
        self._outlet.send(message)
        depth = self._outlet.latched.get(message.channel)
        if depth is not None:
            self._held[message.channel] = [*self._held[message.channel], message.time][-depth:]

    def _following(self, messages: Iterator[Message]) -> Message | None:
        message = next(messages, None)
        return message if message is not None and message.time <= self._playback.end else None

    def _go_to(self, position: int) -> None:
        """Go to `position` [ns]: messages from there on follow, and latched topics are as they were then.

        An InputError, of a file that is damaged there, changes nothing.
        """
        messages = self._log.messages(self._outlet.channels, position)
        following = self._following(messages)
        latched = {channel: self._log.latest(channel, position, n) for channel, n in self._outlet.latched.items()}
        self._messages, self._next = messages, following
        self._outlet.restart()
        self._clock.jump(position)
        for channel, depth in self._outlet.latched.items():
            self._restore(channel, latched[channel], depth)
        if self._playback.clock_rate > 0.0:
            self._send_clock()

    def _restore(self, channel: int, valid: list[Message], depth: int) -> None:
        """Give those who come late the `valid` messages of a latched channel, and nothing that is of another time."""
        held = self._held[channel]
        if held == [message.time for message in valid[: len(held)]]:
            valid = valid[len(held) :]
        elif len(valid) < depth:
            self._outlet.forget(channel)
            self._held[channel] = []
        for message in valid:
            self._send(message)

    def _send_clock(self) -> None:
        self._outlet.send_clock(min(self._clock.now, self._playback.end))

    def _show(self) -> None:
        self._shown_at = time.monotonic()
        self._moved(self.position)

    def _answering(self, action: Callable[[], object]) -> Callable[[Future], None]:
        """Return a function that runs `action`, reports where playing is, and then answers with the action's result."""

        def do(answer: Future) -> None:
            result = action()
            self._show()
            answer.set_result(result)

        return do

    def _state(self) -> str:
        return f"{'paused' if self.paused else 'playing'} at t = {seconds_text(self.position)} s"

    def _do_pause(self) -> str:
        self._clock.stop()
        self._clock.jump(min(self._clock.now, self._next.time if self._next else self._playback.end))
        return self._state()

    def _do_resume(self) -> str:
        self._clock.start()
        return self._state()

    def _do_play_next(self) -> str:
        sent = self._step(self._playback.loop)
        if sent is None:
            raise InputError(f"there is no message after t = {seconds_text(self.position)} s; seek to an earlier time")
        return f"sent {self._topics[sent.channel]} of t = {seconds_text(sent.time)} s"

    def _do_burst(self, count: int) -> int:
        sent = 0
        while (sent < count or count == 0) and self._step(self._playback.loop and count > 0) is not None:
            sent += 1
            if self._stopping.is_set():
                break
        return sent

    def _step(self, again: bool) -> Message | None:
        """Send the next message while paused, after the last one the first if `again`; None if there is none."""
        if not self.paused:
            raise InputError("the log is being played: call pause first")
        if self._next is None and again:
            self._go_to(self._playback.begin)
        if self._next is None:
            return None
        self._clock.jump(self._next.time)
        return self._send_next()

    def _do_seek(self, position: int) -> str:
        first, last = self._log.start, self._playback.end
        if not first <= position <= last:
            span = f"{seconds_text(first)} to {seconds_text(last)} s"
            raise InputError(f"t = {seconds_text(position)} s is not in what is played, which is {span}")
        self._go_to(position)
        return self._state()

    def _do_set_rate(self, rate: float) -> str:
        if not (math.isfinite(rate) and rate > 0.0):
            raise InputError(f"a rate of {rate:g} is not allowed; it must be a finite number > 0")
        self._clock.rate = rate
        return f"{self._state()}, at a rate of {rate:g}"

    def _do_end(self) -> str:
        self._stopping.set()
        return f"stopped at t = {seconds_text(self.position)} s"
