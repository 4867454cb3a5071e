"""The command `bilayer sweep`, as a user sees it."""

import sys

import pytest
import yaml

from bilayer_core.cli import main


@pytest.fixture
def call(strip, tmp_path, capsys):
    """Runs the command on a file; exit code, standard output and standard error."""
    file = tmp_path / "sweep.yaml"

    def run(*arguments, content=strip):
        file.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
        code = main(["sweep", str(file), "--out", str(tmp_path / "out"), *arguments])
        return code, *capsys.readouterr()

    return run


def test_a_sweep_tells_where_it_runs_how_runs_ended_and_what_was_written(call, strip, cluster, tmp_path):
    strip["parameters"]["length"]["values"] = ["80 mm", "-1 mm"]
    code, out, err = call("--scheduler", cluster, "--plot")
    assert code == 0
    assert err.startswith(f"cluster {cluster}, 2 runs side by side\nwarning: whoever reaches the port of")
    lines = out.splitlines()
    assert lines[0] == "4 done, 4 refused"
    assert lines[1].startswith('  4 times, first run 1: refused: scene: rods.strip.path.length: found "-1.0 mm"')
    assert f"wrote {tmp_path / 'out/results.parquet'}" in lines
    assert f"wrote {tmp_path / 'out/map_curvature.png'}" in lines
    again, out, err = call("--scheduler", cluster)
    assert again == 2 and "results are there already; go on with them (--resume), replace them (--force)" in err
    resumed, out, err = call("--scheduler", cluster, "--resume")
    assert resumed == 0 and err == "8 of 8 runs are there\n"  # no process was asked for
    changed, out, err = call("--resume", content=strip | {"set": {"duration": "0.4 s"}})
    assert changed == 2 and "the sweep has changed since its results were begun, in set, the scene;" in err


def test_runs_can_be_listed_without_making_any(call, tmp_path):
    code, out, _ = call("--list")
    assert code == 0
    assert out.splitlines()[:3] == ["number\tgain [%]\tlength [mm]", "0\t0.5\t80.0", "1\t0.5\t100.0"]
    assert not (tmp_path / "out").exists()


def test_what_makes_no_run_leaves_no_directory_behind(call, tmp_path):
    assert call(content="")[0] == call("--resume")[0] == 2
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("", "found nothing; must be a mapping"),
        ("a: [", "sweep.yaml:2:1: is not readable YAML"),
        ("schema: 1\nscene: bending\nparameters: {}\n", "parameters: found {}; must have at least one"),
    ],
)
def test_a_bad_file_is_one_message_and_exit_code_2(call, content, told):
    code, out, err = call(content=content)
    assert code == 2 and told in err and out == "" and "Traceback" not in err


def test_without_dask_the_command_says_what_to_install(call, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, _, err = call()
    assert code == 2
    assert err.endswith("install it with: pip install 'bilayer_sim_ros[sweep]'\n")
