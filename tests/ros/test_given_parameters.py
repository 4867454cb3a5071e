"""What counts of parameters that are given several times, for other nodes or without a flag; in one process."""

import sys

import pytest
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from bilayer_core.errors import InputError
from bilayer_sim_ros.node.configured_node import ConfiguredNode
from bilayer_sim_ros.node.parameters import SIM_NODE
from bilayer_sim_ros.node.ros_arguments import matches
from bilayer_sim_ros.node.unread_arguments import refuse_bare_parameters, unread_arguments
from bilayer_sim_ros.simulation_node import SimulationNode

NAMES = [parameter.name for parameter in SIM_NODE]


@pytest.fixture
def values(domain, tmp_path, monkeypatch):
    """Makes a node with arguments, and parameter files by what they hold; its values, or what it refuses."""
    monkeypatch.chdir(tmp_path)

    def made(words, files=(), **of_node):
        for number, file in enumerate(files):
            (tmp_path / f"{number}.yaml").write_text(file)
        arguments = ["sim_node", "--ros-args", *words.split()]
        context = Context()
        rclpy.init(args=arguments, context=context, domain_id=domain)
        try:
            node = ConfiguredNode("bilayer_sim", SIM_NODE, arguments=arguments, context=context, **of_node)
            node.destroy_node()
            return node.values
        finally:
            rclpy.shutdown(context=context)

    return made


def section(name, value):
    return f"{name}:\n  ros__parameters:\n    duration: {value}\n"


@pytest.mark.parametrize("name", ["/**", "bilayer_sim", "/bilayer_sim", "/*"])
@pytest.mark.parametrize("words", ["-p duration:=0.5 --params-file 0.yaml", "--params-file 0.yaml -p duration:=0.5"])
@pytest.mark.parametrize("in_file", ["2", "2.0"])
def test_the_command_line_goes_before_a_file_in_any_order_and_type(values, name, words, in_file):
    assert values(words, [section(name, in_file)])["duration"] == 0.5


def test_a_whole_number_on_the_command_line_goes_before_a_file(values):
    assert values("-p duration:=3 --params-file 0.yaml", [section("/**", "2.5")])["duration"] == 3.0


def test_the_command_line_goes_before_several_files_and_the_last_word_counts(values):
    files = [section("/**", "2"), section("bilayer_sim", "2.5")]
    words = "--params-file 0.yaml -p duration:=0.25 -p duration:=1 -p duration:=0.5 --params-file 1.yaml"
    assert values(words, files)["duration"] == 0.5


def test_the_command_line_goes_before_files_under_a_namespace_and_another_name(values):
    words = "-r __ns:=/lab -r __node:=left --params-file 0.yaml -p duration:=0.5 -p scene:=bending"
    for name in ("/lab/left", "/lab/*", "/**/left", "lab:\n  left"):
        file = section(name, "2") if "\n" not in name else "lab:\n  left:\n    ros__parameters:\n      duration: 2\n"
        assert values(words, [file])["duration"] == 0.5


@pytest.mark.parametrize("in_files", [("2", "2.5"), ("2.5", "2"), ("2.5", "3.5"), ("2", "1e1")])
def test_of_two_files_the_last_one_counts_whatever_the_types(values, in_files):
    files = [section("/**", text) for text in in_files]
    found = values("--params-file 0.yaml --params-file 1.yaml", files)
    assert found["duration"] == float(in_files[1])


def test_values_in_code_go_before_the_command_line(values):
    overrides = [Parameter("duration", value=0.125)]
    words = "-p duration:=0.5 --params-file 0.yaml"
    assert values(words, [section("/**", "2")], parameter_overrides=overrides)["duration"] == 0.125


def test_arguments_of_the_node_itself_go_before_those_of_the_process(values):
    own = ["--ros-args", "--params-file", "1.yaml", "-p", "duration:=0.75"]
    files = [section("/**", "2"), section("/**", "3")]
    assert values("-p duration:=0.5 --params-file 0.yaml", files, cli_args=own)["duration"] == 0.75


def test_nodes_in_other_programs_read_the_command_line_of_the_process(domain, tmp_path, monkeypatch):
    (tmp_path / "mine.yaml").write_text(section("left", "2"))
    words = ["-p", "scene:=bending", "-p", "duration:=0.5", "--params-file", str(tmp_path / "mine.yaml")]
    monkeypatch.setattr(sys, "argv", ["program", "--ros-args", *words])
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    try:
        nodes = [SimulationNode(name, context=context) for name in ("left", "right")]
        assert [node.values["duration"] for node in nodes] == [0.5, 0.5]
        own = SimulationNode("own", context=context, use_global_arguments=False)
        assert own.values["duration"] == 0.0
        for node in (*nodes, own):
            node.destroy_node()
    finally:
        rclpy.shutdown(context=context)


def test_the_former_name_of_a_parameter_works_at_the_start(values, capfd):
    assert values("-p friction:=0.3")["friction.coefficient"] == 0.3
    warning = "parameter 'friction' is now called 'friction.coefficient'"
    assert capfd.readouterr().err.count(warning) == 1
    file = "/**:\n  ros__parameters:\n    friction: 1\n"
    assert values("-p friction.coefficient:=0.3 --params-file 0.yaml", [file])["friction.coefficient"] == 0.3
    overrides = [Parameter("friction", value=0.1)]
    with pytest.raises(InputError, match=r"'friction.coefficient' is given twice: .*0\.1.* the former name 'friction'"):
        values("-p friction.coefficient:=0.3", parameter_overrides=overrides)


@pytest.mark.parametrize(
    ("pattern", "node", "fits"),
    [
        ("/**", "/a/b", True),
        ("/**/b", "/b", True),
        ("/**/b", "/a/c/b", True),
        ("/a/*", "/a/b", True),
        ("/a/*", "/a/b/c", False),
        ("b", "/b", True),
        ("/b", "/a/b", False),
        ("/a.", "/ab", False),
    ],
)
def test_sections_are_for_the_nodes_that_ros_takes_them_for(pattern, node, fits):
    assert matches(pattern, node) == fits


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("scene:=x", "'scene:=x' sets no parameter, as it has no -p before it; write --ros-args -p scene:=x"),
        ("--ros-args scene:=x -p dt:=1", "write --ros-args -p scene:=x"),
        ("--ros-args -p dt:=1 scen:=x", "write --ros-args -p scene:=x"),
    ],
)
def test_a_parameter_without_its_flag_is_refused_with_what_to_write(words, said):
    with pytest.raises(InputError) as refused:
        refuse_bare_parameters(["sim_node", *words.split()], NAMES)
    assert said in str(refused.value)


@pytest.mark.parametrize("words", ["com:=/c", "--ros-args -r com:=/c -p scene:=x --param dt:=1", "run.mcap --debug"])
def test_remappings_and_parameters_with_their_flag_are_let_through(words):
    assert refuse_bare_parameters(["sim_node", *words.split()], NAMES) is None


BOTH = section("/**", "2") + "/bilayer_simm:\n  ros__parameters:\n    rate: 50\n"


@pytest.mark.parametrize(
    ("words", "file", "said"),
    [
        (
            "--params-file 0.yaml",
            section("/bilayer_simm", "2"),
            "are for /bilayer_simm, this node is /bilayer_sim; write",
        ),
        (
            "--params-file 0.yaml",
            section("/lab/bilayer_sim", "2"),
            "are for /lab/bilayer_sim, this node is /bilayer_sim",
        ),
        ("--params-file 0.yaml", BOTH, "the parameters of /bilayer_simm are not read: did you mean /bilayer_sim?"),
        ("-p bilayer_simm:duration:=2", "", "it is for the node /bilayer_simm, this one is /bilayer_sim; write -p dur"),
        ("-r scene:=x", "", "for that write -p scene:=x"),
        ("--params-file 0.yaml", section("/**", "2") + section("/other_node", "3"), None),
        ("--params-file 0.yaml", section("/bilayer_sim", "2") + section("/lab/bilayer_sim", "3"), None),
        ("-p bilayer_sim:duration:=2 -r com:=/c", "", None),
    ],
)
def test_parameters_for_another_node_are_told_with_what_to_write(tmp_path, monkeypatch, words, file, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "0.yaml").write_text(file)
    found = list(unread_arguments(["sim_node", "--ros-args", *words.split()], "/bilayer_sim", NAMES))
    assert (len(found) == 1 and said in found[0]) if said else found == []


def test_an_executable_tells_what_it_does_not_read(start, domain, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(section("/bilayer_sim", "2"))
    process = start("replay_node", domain, {}, ["--ros-args", "--params-file", file])
    assert process.wait() == 2  # as there is no log
    assert f"nothing of {file} is read: its parameters are for /bilayer_sim, this node is /bilayer_replay" in (
        process.output
    )
    process = start("sim_node", domain, {}, ["scene:=bending"])
    assert process.wait() == 2
    (line,) = process.output.splitlines()
    assert line == (
        "sim_node: 'scene:=bending' sets no parameter, as it has no -p before it; write --ros-args -p scene:=bending"
    )
