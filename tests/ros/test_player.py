"""The player by itself: its messages go into a list."""

import threading
import time
import tracemalloc
from contextlib import suppress

import pytest
from support.written_logs import LATCHED, damage, number, value_of, write_log

from bilayer_core.errors import InputError
from bilayer_core.log.file.indexed_log import IndexedLog
from bilayer_sim_ros.replay.player import Playback, Player

FAST = 1e6
"""A rate at which any of these logs takes no time."""
SECOND = 1_000_000_000
LIMIT = 30.0


class Outlet:
    """Notes what is sent: (topic, value); ("/clock", time [ns]); ("forget", topic)."""

    def __init__(self, log, latched, delay):
        self._topics = {channel.number: channel.topic for channel in log.channels}
        self.channels = list(self._topics)
        self.latched = {channel: latched[topic] for channel, topic in self._topics.items() if topic in latched}
        self._delay = delay
        self.sent, self.times, self.passes, self.instants = [], [], [], []

    def finish_instant(self):
        self.instants.append(len(self.sent))

    def restart(self):
        self.passes.append(len(self.sent))

    def send(self, message):
        time.sleep(self._delay)
        self.sent.append((self._topics[message.channel], value_of(message.data)))
        self.times.append(time.monotonic())

    def forget(self, channel):
        self.sent.append(("forget", self._topics[channel]))

    def send_clock(self, stamp):
        self.sent.append(("/clock", stamp))

    def flush(self):
        pass


@pytest.fixture
def play(tmp_path):
    """Starts players of logs with given messages."""
    started = []

    def begin(
        messages, latched=None, delay=0.0, begin=0.0, duration=1e9, first=None, behind=print, damaged=False, **options
    ):
        path = write_log(tmp_path / f"{len(started)}.mcap", messages, qos=dict.fromkeys(latched or {}, LATCHED))
        if damaged:
            damage(path)
        log = IndexedLog(path)
        start = log.start + round(begin * SECOND)
        end = min(log.end, start + round(duration * SECOND))
        playback = Playback(start, end, start if first is None else round(first * SECOND), **options)
        outlet, finished = Outlet(log, latched or {}, delay), threading.Event()
        player = Player(log, outlet, playback, behind=behind, finished=finished.set)
        player.outlet, player.finished, player.log = outlet, finished, log
        started.append(player)
        player.start()
        return player

    yield begin
    for player in started:
        player.stop()
        player.log.close()


def counted(count=10, period=0.1, topic="/a", begin=0.0):
    return [(topic, begin + index * period, number(index)) for index in range(count)]


def values(player, topic="/a"):
    return [value for name, value in player.outlet.sent if name == topic]


def wait_for(condition):
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def ask(future):
    return future.result(LIMIT)


def bother(player):
    """Ask, and so wake the player, until it ends."""
    with suppress(InputError):
        while not player.finished.is_set():
            ask(player.is_paused())
            time.sleep(0.001)


def played(player):
    assert player.finished.wait(LIMIT)
    assert player.error is None
    return values(player)


def test_all_messages_go_out_once_and_by_time(play):
    messages = counted(300) + counted(300, topic="/b", begin=0.05)
    player = play(messages, rate=FAST)
    played(player)
    expected = sorted(((time, topic, value_of(data)) for topic, time, data in messages))
    assert player.outlet.sent == [(topic, value) for _, topic, value in expected]


def test_each_pass_and_the_end_of_each_instant_are_told(play):
    player = play([*counted(2, 0.0), *counted(2, 0.0, "/b", 0.5)], paused=True, loop=True)
    assert ask(player.burst(5)) == 5
    ask(player.seek(0))
    assert player.outlet.passes == [0, 4, 5]
    assert player.outlet.instants == [2, 4]


@pytest.mark.parametrize("rate", [0.5, 2.0])
def test_no_message_goes_out_before_its_time(play, rate):
    begin = time.monotonic()
    player = play(counted(10, 0.02), rate=rate)
    bother(player)
    assert played(player) == list(range(10))
    times = [at - begin for at in player.outlet.times]
    assert all(at >= 0.02 * index / rate for index, at in enumerate(times))
    assert player.lag or times[-1] < 0.18 / rate + 0.2


def test_offset_and_duration_bound_what_is_played_both_included(play):
    assert played(play(counted(), begin=0.3, duration=0.4, rate=FAST)) == [3, 4, 5, 6, 7]


def test_a_duration_of_zero_plays_the_messages_of_the_first_instant(play):
    assert played(play(counted(3, 0.0) + counted(5, begin=1.0), duration=0.0, rate=FAST)) == [0, 1, 2]


def test_the_end_waits_for_the_time_that_was_asked_for(play):
    begin = time.monotonic()
    player = play(counted(2, 0.0) + [("/a", 5.0, number(2))], duration=0.2)
    bother(player)
    assert played(player) == [0, 1]
    assert time.monotonic() - begin >= 0.2
    assert player.position == SECOND // 5


def test_a_loop_begins_again_at_the_offset_until_it_is_stopped(play):
    player = play(counted(5), begin=0.2, loop=True, rate=100.0)
    wait_for(lambda: len(values(player)) >= 10)
    player.stop()
    assert values(player)[:9] == [2, 3, 4] * 3
    assert player.error is None


def test_a_loop_over_one_instant_is_refused(play):
    with pytest.raises(InputError, match="in a loop takes 0 s"):
        play(counted(3, 0.0), loop=True)


def test_a_paused_player_sends_one_message_when_it_is_asked_for_the_next(play):
    player = play(counted(3), paused=True)
    assert ask(player.is_paused()) == (True, "paused at t = 0 s")
    assert values(player) == []
    assert ask(player.play_next()) == "sent /a of t = 0 s"
    assert ask(player.play_next()) == "sent /a of t = 0.1 s"
    assert values(player) == [0, 1]
    assert player.paused and player.position == SECOND // 10


def test_a_paused_player_stays_paused_after_a_seek_and_plays_on_from_there(play):
    player = play(counted(), paused=True)
    for position, expected in ((0.55, 6), (0.9, 9), (0.0, 0), (0.3, 3)):
        ask(player.seek(round(position * SECOND)))
        assert player.paused and player.position == round(position * SECOND)
        ask(player.play_next())
        assert values(player)[-1] == expected
    assert len(values(player)) == 4


def test_a_seek_while_playing_goes_on_from_there(play):
    player = play(counted(100, 1.0))
    wait_for(lambda: values(player))
    ask(player.seek(95 * SECOND))
    ask(player.set_rate(FAST))
    assert played(player) == [0, 95, 96, 97, 98, 99]


@pytest.mark.parametrize("position", [-1, 10 * SECOND])
def test_a_seek_out_of_the_log_is_refused_and_changes_nothing(play, position):
    player = play(counted(), paused=True, first=0.4)
    with pytest.raises(InputError, match=r"is not in what is played, which is 0 to 0\.9 s"):
        ask(player.seek(position))
    ask(player.play_next())
    assert values(player) == [4]


def test_after_the_last_message_there_is_no_next_one_but_one_may_go_back(play):
    player = play(counted(2), paused=True, first=0.1)
    ask(player.play_next())
    with pytest.raises(InputError, match=r"no message after t = 0\.1 s; seek"):
        ask(player.play_next())
    ask(player.seek(0))
    ask(player.play_next())
    assert values(player) == [1, 0]


def test_in_a_loop_the_first_message_follows_the_last(play):
    player = play(counted(2), paused=True, loop=True)
    for _ in range(3):
        ask(player.play_next())
    assert values(player) == [0, 1, 0]


def test_bursts_send_as_many_messages_as_there_are_and_only_while_paused(play):
    player = play(counted(), paused=True)
    assert ask(player.burst(4)) == 4
    assert ask(player.burst(0)) == 6
    assert ask(player.burst(1)) == 0
    assert values(player) == list(range(10))
    player = play(counted(), rate=1e-3)
    for asked in (player.burst, lambda _: player.play_next()):
        with pytest.raises(InputError, match="call pause first"):
            ask(asked(1))


def test_pause_and_resume_keep_the_time_and_lose_no_message(play):
    player = play(counted(30, 0.01))
    for _ in range(5):
        ask(player.toggle_paused())
        at = player.position
        count = len(values(player))
        time.sleep(0.03)
        assert (player.position, len(values(player))) == (at, count)
        assert ask(player.toggle_paused()).startswith("playing")
    assert played(player) == list(range(30))


def test_another_rate_acts_at_once_and_time_goes_on_from_where_it_is(play):
    player = play(counted(2, 1000.0))
    wait_for(lambda: values(player))
    before = player.position
    ask(player.set_rate(1e-6))
    assert before <= player.position < 900 * SECOND
    ask(player.set_rate(FAST))
    assert played(player) == [0, 1]


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_rate_that_is_not_above_0_is_refused(play, rate):
    player = play(counted(), paused=True)
    with pytest.raises(InputError, match="must be a finite number > 0"):
        ask(player.set_rate(rate))
    assert player.rate == 1.0


def test_the_end_can_be_asked_for_and_then_nothing_more(play):
    player = play(counted(), paused=True, first=0.5)
    assert ask(player.end()) == "stopped at t = 0.5 s"
    assert played(player) == []
    with pytest.raises(InputError, match="playing has ended"):
        ask(player.play_next())


def test_what_cannot_keep_up_leaves_nothing_out_and_says_how_late_it_is(play):
    told, begin = [], time.monotonic()
    player = play(counted(40, 0.01), delay=0.02, rate=2.0, behind=told.append)
    assert played(player) == list(range(40))
    assert told and told[-1] == player.lag
    assert 0.2 < player.lag < time.monotonic() - begin  # 40 times 20 ms for 0.2 s of the log


def test_the_clock_goes_at_its_own_rate_while_playing_and_paused(play):
    begin = time.monotonic()
    player = play(counted(2, 100.0), paused=True, clock_rate=200.0, first=50.0)
    wait_for(lambda: len(values(player, "/clock")) > 5)
    assert time.monotonic() - begin < 2.5
    assert set(values(player, "/clock")) == {50 * SECOND}
    ask(player.resume())
    wait_for(lambda: len(set(values(player, "/clock"))) > 5)
    times = values(player, "/clock")
    assert times == sorted(times)
    ask(player.set_rate(FAST))
    assert played(player) == [1]
    assert max(values(player, "/clock")) <= 100 * SECOND


def test_a_clock_with_the_time_of_each_message_goes_out_right_before_it(play):
    player = play(counted(3, 0.5) + [("/b", 0.5, number(7))], rate=FAST, clock_on_publish=True)
    played(player)
    half = SECOND // 2
    expected = [("/clock", 0), ("/a", 0), ("/clock", half), ("/a", 1), ("/clock", half), ("/b", 7)]
    assert player.outlet.sent == [*expected, ("/clock", SECOND), ("/a", 2)]


LATCHES = [("/map", 1.0, number(1)), ("/map", 3.0, number(3)), ("/map", 5.0, number(5))]


@pytest.mark.parametrize(
    ("depth", "sent"),
    [
        # At 2 s, 6 s, 6.5 s, 4 s, 0.5 s, 2 s.
        (1, [[1], [5], [], [3], ["forget"], [1]]),
        (2, [[1], [3, 5], [], [1, 3], ["forget"], [1]]),
        (9, [[1], [3, 5], [], ["forget", 1, 3], ["forget"], [1]]),
    ],
)
def test_after_a_seek_those_who_come_late_get_what_was_valid_then(play, depth, sent):
    player = play([*LATCHES, ("/a", 0.0, number(0)), ("/a", 9.0, number(9))], latched={"/map": depth}, paused=True)
    found = []
    for position in (2.0, 6.0, 6.5, 4.0, 0.5, 2.0):
        del player.outlet.sent[:]
        ask(player.seek(round(position * SECOND)))
        found.append([value if topic == "/map" else topic for topic, value in player.outlet.sent])
    assert found == sent


def test_an_offset_begins_with_what_was_valid_then(play):
    player = play([*LATCHES, ("/a", 9.0, number(9))], latched={"/map": 1}, begin=4.0, rate=FAST)
    played(player)
    assert player.outlet.sent == [("/map", 3), ("/map", 5), ("/a", 9)]


def test_a_damaged_place_ends_playing_but_only_refuses_a_seek(play):
    player = play(counted(100), paused=True, damaged=True)
    with pytest.raises(InputError, match="damaged"):
        for position in range(100):
            ask(player.seek(position * SECOND // 10))
    ask(player.seek(0))
    ask(player.play_next())
    assert values(player) == [0]
    ask(player.set_rate(FAST))
    ask(player.resume())
    assert player.finished.wait(LIMIT)
    assert isinstance(player.error, InputError) and player.error.exit_code == 2
    assert 20 < len(values(player)) < 60 and values(player) == list(range(len(values(player))))


def test_a_log_is_never_in_memory_as_a_whole(tmp_path):
    megabyte = bytes(number(0)) + bytes(1_000_000)
    path = write_log(tmp_path / "run.mcap", (("/a", 0.1 * k, megabyte) for k in range(40)), chunk_size=2_000_000)
    with IndexedLog(path) as log:
        outlet, finished = Outlet(log, {}, 0.0), threading.Event()
        player = Player(log, outlet, Playback(log.start, log.end, log.start, rate=FAST), finished=finished.set)
        tracemalloc.start()
        try:
            player.start()
            assert finished.wait(LIMIT)
            largest = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
            player.stop()
    assert len(outlet.sent) == 40
    assert largest < 12e6
