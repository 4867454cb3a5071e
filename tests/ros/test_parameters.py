import pytest
import yaml

from bilayer_core.errors import InputError
from bilayer_sim_ros.node.parameters import BUILT_IN, REPLAY_NODE, SIM_NODE, NodeParameter, accept_all

RATE = NodeParameter("rate", 50.0, "messages per second [Hz]", minimum=0.0, above_minimum=True)
MODE = NodeParameter("mode", "hold", "what acts", choices=("hold", "zero"))
CLOCK = NodeParameter("clock", True, "publish the clock")
TABLE = (RATE, MODE, CLOCK)


def test_defaults_fill_what_is_not_given():
    assert accept_all(TABLE, {"mode": "zero"}) == {"rate": 50.0, "mode": "zero", "clock": True}


def test_an_integer_will_do_for_a_number():
    value = RATE.accept(20)
    assert (value, type(value)) == (20.0, float)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf"), True, "fast", [1.0]])
def test_a_bad_number_is_refused_with_its_value_and_what_is_allowed(value):
    with pytest.raises(InputError, match="parameter 'rate' is .*allowed is a finite number > 0"):
        RATE.accept(value)


@pytest.mark.parametrize("value", ["holt", 1, True])
def test_a_text_outside_the_choices_is_refused_and_the_choices_are_listed(value):
    with pytest.raises(InputError, match="'mode'.*one of hold, zero"):
        MODE.accept(value)


def test_an_integer_will_do_for_a_choice_that_is_one():
    assert accept_all(SIM_NODE, {"dimension": 2})["dimension"] == "2"
    with pytest.raises(InputError, match="'dimension' is '4'; allowed is one of auto, 2, 3"):
        accept_all(SIM_NODE, {"dimension": 4})


@pytest.mark.parametrize("value", [1, "yes", 0.0])
def test_a_switch_takes_only_true_or_false(value):
    with pytest.raises(InputError, match="'clock'.*true or false"):
        CLOCK.accept(value)


def test_off_is_a_word_though_parameter_files_take_it_for_false():
    rerun = next(of for of in SIM_NODE if of.name == "rerun")
    assert rerun.accept(False) == rerun.accept("off") == "off"
    with pytest.raises(InputError, match="'rerun' is True"):
        rerun.accept(True)


def test_a_mistyped_name_is_refused_with_a_suggestion_and_all_names():
    with pytest.raises(InputError, match=r"no parameter 'raet': did you mean 'rate'\?.*rate, mode, clock"):
        accept_all(TABLE, {"raet": 1.0})


@pytest.mark.parametrize("name", ["use_sim_time", "qos_overrides./clock.publisher.depth"])
def test_parameters_of_every_ros_node_are_let_through(name):
    assert name not in accept_all(TABLE, {name: 1})


def test_the_parameter_file_lists_every_parameter_with_its_default(root):
    content = yaml.safe_load((root / "config" / "sim_node.yaml").read_text())
    assert content["/**"]["ros__parameters"] == {p.name: p.default for p in SIM_NODE}


@pytest.mark.parametrize("table", [SIM_NODE, REPLAY_NODE])
def test_every_default_is_allowed(table):
    assert accept_all(table, {}) == {p.name: p.default for p in table}


@pytest.mark.parametrize("table", [SIM_NODE, REPLAY_NODE])
def test_no_name_of_a_parameter_is_the_prefix_of_another(table):
    names = {*BUILT_IN, *(parameter.name for parameter in table)}
    assert not [name for name in names for other in names if other.startswith(f"{name}.")]
