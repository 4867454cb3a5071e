"""Services with rosbag2's names and types; these types have no wheel, so that ones with their fields stand for them."""

import sys
from concurrent.futures import Future
from types import ModuleType, SimpleNamespace

import pytest
from builtin_interfaces.msg import Time

from bilayer_core.errors import InputError
from bilayer_sim_ros.services.rosbag2_services import rosbag2_services

TYPES = "Pause Resume TogglePaused IsPaused GetRate SetRate Play PlayNext Burst Seek Stop".split()


class NotedPlayer:
    """Notes what it is asked for; refuses what is in `refused`."""

    rate = 2.5

    def __init__(self):
        self.asked, self.refused = [], {}

    def __getattr__(self, name):
        results = {"is_paused": (False, "playing"), "burst": 7}

        def ask(*arguments):
            self.asked.append((name, *arguments))
            future = Future()
            if name in self.refused:
                future.set_exception(InputError(self.refused[name]))
            else:
                future.set_result(results.get(name, "done"))
            return future

        return ask


@pytest.fixture
def player():
    return NotedPlayer()


@pytest.fixture
def warnings():
    return []


@pytest.fixture
def call(player, warnings, monkeypatch):
    """Calls a service; the fields of its answer."""
    package, types = ModuleType("rosbag2_interfaces"), ModuleType("rosbag2_interfaces.srv")
    package.srv = types
    for name in TYPES:
        setattr(types, name, name)
    monkeypatch.setitem(sys.modules, "rosbag2_interfaces", package)
    monkeypatch.setitem(sys.modules, "rosbag2_interfaces.srv", types)
    monkeypatch.setattr("bilayer_sim_ros.services.rosbag2_services.check_is_valid_srv_type", lambda _: None)
    logger = SimpleNamespace(warning=warnings.append)
    services = rosbag2_services(SimpleNamespace(get_logger=lambda: logger), player)
    by_name = {service.name: service for service in services}

    def answered(name, **request):
        response = SimpleNamespace()
        service = by_name[name]
        assert service.type == "".join(part.capitalize() for part in name.split("_"))
        service.answer(response, service.ask(SimpleNamespace(**request)))
        return vars(response)

    answered.names = set(by_name)
    return answered


def test_all_services_of_its_player_are_there(call):
    names = "pause resume toggle_paused is_paused get_rate set_rate play play_next burst seek stop"
    assert call.names == set(names.split())


def test_answers_have_the_fields_of_its_types(call, player):
    for name in ("pause", "resume", "toggle_paused", "stop"):
        assert call(name) == {}
    assert call("is_paused") == {"paused": False}
    assert call("get_rate") == {"rate": 2.5}
    assert call("set_rate", rate=3.0) == {"success": True}
    assert call("play_next") == {"success": True}
    assert call("burst", num_messages=9) == {"actually_burst": 7}
    assert call("seek", time=Time(sec=1_795_441_161, nanosec=309_531_199)) == {"success": True}
    assert ("set_rate", 3.0) in player.asked and ("burst", 9) in player.asked
    assert ("seek", 1_795_441_161_309_531_199) in player.asked
    assert player.asked[3] == ("end",)


def test_a_refusal_is_no_success_and_a_warning_says_why(call, player, warnings):
    player.refused = dict.fromkeys(("set_rate", "play_next", "burst", "seek", "pause"), "call pause first")
    assert call("set_rate", rate=-1.0) == call("play_next") == {"success": False}
    assert call("seek", time=Time()) == {"success": False}
    assert call("burst", num_messages=1) == {"actually_burst": 0}
    assert call("pause") == {}
    assert warnings == ["refused: call pause first"] * 5


def test_play_is_dismissed_while_the_log_is_played(call, player, warnings):
    assert call("play") == {"success": False}
    assert player.asked == [] and "dismissed" in warnings[0]


def test_without_its_types_the_error_names_the_package_and_the_other_choice(player):
    with pytest.raises(InputError, match="'rosbag2'.*package rosbag2_interfaces.*or take 'std_srvs'"):
        rosbag2_services(SimpleNamespace(), player)


def test_types_whose_libraries_are_missing_are_told_likewise(player, monkeypatch):
    package = ModuleType("rosbag2_interfaces")
    package.srv = SimpleNamespace(IsPaused=object)
    monkeypatch.setitem(sys.modules, "rosbag2_interfaces", package)
    with pytest.raises(InputError, match="'rosbag2'.*cannot be imported .*or take 'std_srvs'"):
        rosbag2_services(SimpleNamespace(), player)
