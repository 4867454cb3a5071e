"""Launch files have an argument for each parameter; a stand-in for `launch`, which has no wheel, notes them."""

import importlib.util
import sys
from types import ModuleType, SimpleNamespace

import pytest

from bilayer_core.errors import InputError
from bilayer_sim_ros.node.launch_arguments import argument_name, near_misses, parameters_of
from bilayer_sim_ros.node.parameters import REPLAY_NODE, SIM_NODE, accept_all

DECLARED = ["name", "namespace", "params_file", *map(argument_name, SIM_NODE)]


def test_empty_arguments_leave_what_the_file_of_parameters_says():
    assert parameters_of(SIM_NODE, dict.fromkeys(DECLARED, "")) == {}


def test_texts_become_values_of_the_types_of_parameters():
    given = {"real_time_factor": "2", "lockstep": "True", "log": "2.mcap", "rerun": "off", "scene": "10"}
    found = parameters_of(SIM_NODE, given | {"lockstep_answers": "[hind, left]"})
    assert found == {
        "real_time_factor": 2.0,
        "lockstep": True,
        "log": "2.mcap",
        "rerun": "off",
        "scene": "10",
        "lockstep_answers": ["hind", "left"],
    }
    assert parameters_of(SIM_NODE, {"lockstep_answers": "hind, left"})["lockstep_answers"] == ["hind", "left"]
    assert accept_all(SIM_NODE, found)["real_time_factor"] == 2.0


@pytest.mark.parametrize(
    ("name", "text"),
    [("rate", "fast"), ("rate", "-1"), ("lockstep", "1"), ("stimulus_fallback", "no"), ("lockstep_answers", "[1, 2]")],
)
def test_a_text_that_is_no_value_is_refused_by_the_name_of_the_parameter(name, text):
    with pytest.raises(InputError, match=f"parameter '{name}' is .*; allowed is"):
        parameters_of(SIM_NODE, {name: text})


def test_arguments_of_the_player_have_short_names():
    found = parameters_of(REPLAY_NODE, {"rate": "2", "clock": "40", "loop": "true", "log": "run.mcap"})
    assert found == {"play.rate": 2.0, "play.clock_publish_frequency": 40.0, "play.loop": True, "log": "run.mcap"}
    assert len(set(map(argument_name, REPLAY_NODE))) == len(REPLAY_NODE)


def test_the_former_name_of_an_argument_still_works():
    assert parameters_of(SIM_NODE, {"friction": "0.3"}) == {"friction": 0.3}
    assert parameters_of(SIM_NODE, {"friction.coefficient": "0.3"}) == {"friction.coefficient": 0.3}


def test_arguments_that_almost_have_the_name_of_one_are_told():
    assert near_misses(DECLARED, ["scene", "real_time_facto", "logg", "use_rviz", "world"]) == [
        "launch argument 'real_time_facto' is not read: did you mean 'real_time_factor'?",
        "launch argument 'logg' is not read: did you mean 'log'?",
    ]


class Noted(SimpleNamespace):
    """Keeps the arguments that it was made with."""

    def __init__(self, *positional, **named):
        super().__init__(positional=positional, **named)


@pytest.fixture
def warnings(monkeypatch):
    """Puts the stand-in in place of `launch`; the warnings that are logged."""
    said = []
    modules = {
        "launch": {"LaunchContext": Noted, "LaunchDescription": Noted},
        "launch.actions": {"DeclareLaunchArgument": Noted, "OpaqueFunction": Noted},
        "launch.logging": {"get_logger": lambda name: SimpleNamespace(warning=said.append)},
        "launch_ros": {},
        "launch_ros.actions": {"Node": Noted},
    }
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "bilayer_sim_ros.node.launch_description", raising=False)
    yield said
    sys.modules.pop("bilayer_sim_ros.node.launch_description", None)


@pytest.mark.parametrize(
    ("file", "executable", "table"), [("simulation", "sim_node", SIM_NODE), ("replay", "replay_node", REPLAY_NODE)]
)
def test_launch_files_declare_all_arguments_and_start_one_node(root, warnings, file, executable, table):
    path = root / "bilayer_sim_ros" / "launch" / f"{file}.launch.py"
    spec = importlib.util.spec_from_file_location(f"{file}_launch", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    (described,) = module.generate_launch_description().positional
    *arguments, function = described
    declared = {argument.positional[0]: argument for argument in arguments}
    assert declared.keys() == {"name", "namespace", "params_file", *map(argument_name, table)}
    assert all(parameter.description in declared[argument_name(parameter)].description for parameter in table)
    given = {name: argument.default_value for name, argument in declared.items()}
    (node,) = function.function(SimpleNamespace(launch_configurations=given))
    assert (node.package, node.executable, node.parameters) == ("bilayer_sim_ros", executable, [])
    assert node.ros_arguments == []
    given |= {"params_file": "mine.yaml", "log": "a.mcap", "rat": "2"}
    (node,) = function.function(SimpleNamespace(launch_configurations=given))
    assert node.parameters == ["mine.yaml"]
    assert node.ros_arguments == ["-p", 'log:="a.mcap"']
    assert warnings == ["launch argument 'rat' is not read: did you mean 'rate'?"]
    with pytest.raises(RuntimeError, match=f"{executable}: parameter .*'fast'"):
        function.function(SimpleNamespace(launch_configurations=given | {"rate": "fast"}))
