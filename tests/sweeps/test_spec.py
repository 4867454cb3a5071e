"""Sweep files: what is refused, and the words for it."""

import pytest

from bilayer_core.errors import InputError
from bilayer_core.scene.loader import load_scene, scene_text
from bilayer_core.studies.sweeps.design import runs_of
from bilayer_core.studies.sweeps.run_sweep import read_sweep
from bilayer_core.studies.sweeps.spec import read_spec


def changed(content, path, value):
    here = content
    *parents, last = path.split("/")
    for key in parents:
        here = here[key]
    if value is None:
        del here[last]
    else:
        here[last] = value
    return content


GAIN = "parameters/gain"


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        ("parameter", {}, "parameter: unknown key, did you mean parameters?"),
        ("parameters", {}, "must have at least one"),
        ("scene", None, "scene: is missing"),
        (f"{GAIN}/path", None, "parameters.gain.path: found null; must be given"),
        (f"{GAIN}/count", None, "parameters.gain.count: found null; must be given for the design grid"),
        (f"{GAIN}/count", 1, "must be at least 2"),
        (f"{GAIN}/count", 1.5, "must be a whole number"),
        (f"{GAIN}/to", "0.5 %", "must be above `from` (0.5): the range is empty"),
        (f"{GAIN}/to", "2 mm", "must have a unit as `from` has (%)"),
        (f"{GAIN}/to", 0.02, "must have a unit as `from` has (%)"),
        (f"{GAIN}/to", "two", "must be a number, with or without a unit"),
        (f"{GAIN}/to", None, "a range has two ends"),
        (f"{GAIN}/values", [1], "must be given, or `from` and `to` instead of it"),
        ("parameters/length/values", [], "must have at least one value"),
        ("parameters/length/values", ["80 mm", "3 s"], "must have units of one kind"),
        ("parameters/length/values", ["80 mmm"], "must have a unit that is known; whose unit 'mmm' is not known"),
        (f"{GAIN}/spacing", "logarithmic", "must be 'linear' or 'log'"),
        (f"{GAIN}/from", "-1 %", None),
        ("parameters/outcome", {"path": "duration", "values": [1]}, "outcome is a column of results anyway"),
        ("design", "random", "must be 'grid', 'list', 'sobol' or 'latin_hypercube'"),
        ("design", "list", "must have the same number of values each"),
        ("design", "sobol", "samples: found null; must be given for the design sobol"),
        ("samples", 8, "samples: found 8; must be left out for the design grid"),
        ("metrics/gain", "steps", "must be a name that no parameter and no other column has"),
        ("metrics/height", {"quantity": "com.z"}, "take: is missing"),
        ("metrics/height", {"take": "max"}, "one of `summary`, `quantity`, `function`"),
        ("metrics/height", {"function": "grip"}, "function"),
        ("objectives", {"hight": "maximise"}, "did you mean height?"),
        ("logs", "some", "logs"),
        ("logs", {"hight": {"above": 1}}, "must be a column of results"),
        ("limits", {"wall_time": 0}, "must be a time"),
        ("limits", {"memory": "2 m"}, "must be a memory size"),
        ("schema", 2, "schema"),
    ],
)
def test_what_a_sweep_file_cannot_say_is_told_with_its_key(strip, path, value, told):
    content = changed(strip, path, value)
    if told is None:
        assert read_spec(content)
        return
    with pytest.raises(InputError) as error:
        read_spec(content)
    assert told in str(error.value)
    assert "Error" not in str(error.value)


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        (f"{GAIN}/path", "rods.strip.layers.activ.eigenstrain.gain", "there is no activ of rods.strip.layers, did you"),
        ("set", {"durations": 1}, "did you mean duration?"),
        ("scene", "bendin", "did you mean bending?"),
        ("metrics/curvature", "max_curvatures", "metrics.curvature: there is no max_curvatures in the summary"),
        ("metrics/curvature", "com_end", "take one of com_end.0, com_end.1, com_end.2"),
        ("metrics/curvature", "com_end.3", "there is no com_end.3"),
        ("metrics/height/quantity", "con.z", "near it: com"),
        ("metrics/height/quantity", "rod/strip/active/curvature", "sweep: quantity 'rod/strip/active/curvature'"),
        ("metrics/height/quantity", "com", "take one of com.x, com.y, com.z"),
        ("metrics/height/quantity", "rod/strip/curvature", "`node` must say which, 0 to 40"),
        ("metrics/height", {"function": "math:sqrt"}, "math is no .py file; must be FILE.py:NAME"),
        ("metrics/height", {"function": "absent.py:grip"}, "metrics.height: found 'absent.py:grip'"),
        ("parameters/length/values", ["-80 mm", "-100 mm"], "must have an acceptable scene"),
        ("logs", "all", "a directory for results must be given"),
    ],
)
def test_what_the_scene_lacks_is_told_before_the_first_run(strip, path, value, told):
    if told == "must have an acceptable scene":
        told = "none of the runs that were tried has an acceptable scene; the first: scene: rods.strip.path.length"
    with pytest.raises(Exception) as error:
        read_sweep(changed(strip, path, value))
    assert type(error.value).__module__ == "bilayer_core.errors"
    assert told in str(error.value)


@pytest.mark.parametrize("content", [None, [], "no_such_file.yaml", 3])
def test_what_is_no_sweep_file_is_an_input_error(content):
    with pytest.raises(InputError):
        read_spec(content)


def test_a_directory_and_a_log_are_no_sweep_files(tmp_path):
    (tmp_path / "run.yaml").write_bytes(b"\x89MCAP0")
    for path, told in ((tmp_path, "is a directory"), (tmp_path / "run.yaml", "is an MCAP log")):
        with pytest.raises(InputError, match=told):
            read_spec(path)


def test_a_million_runs_are_allowed_and_more_are_not(strip):
    strip["parameters"]["gain"]["count"] = 500_000
    assert sum(1 for _ in zip(range(10), runs_of(read_spec(strip)[0]), strict=False)) == 10
    strip["parameters"]["gain"]["count"] = 500_001
    with pytest.raises(InputError, match="1000002 runs; at most 1000000"):
        read_sweep(strip)


def test_files_are_relative_to_the_sweep_file(tmp_path, monkeypatch):
    folder = tmp_path / "there"
    folder.mkdir()
    (folder / "own.yaml").write_text(scene_text(load_scene("bending")))
    (folder / "grip.py").write_text("def grip(run):\n    return 1.0\n")
    (folder / "sweep.yaml").write_text(
        "schema: 1\nscene: own.yaml\nparameters: {t: {path: duration, values: [0.1]}}\n"
        "metrics: {grip: {function: 'grip.py:grip'}}\n"
    )
    monkeypatch.chdir(tmp_path)
    assert read_sweep(folder / "sweep.yaml").job.codes["grip.py:grip"].name == "grip"
