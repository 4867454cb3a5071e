"""The sweeps that come with the simulator: they build, and show what docs/designs.md says."""

import copy
import math

import numpy as np
import pytest

from bilayer_core import Recorder, Simulator, load_scene
from bilayer_core.scene.bundled import bundled_sweeps
from bilayer_core.scene.loader import load_content, scene_content
from bilayer_core.studies.sweeps.execute_runs import execute, scene_of
from bilayer_core.studies.sweeps.job import Outcome, Point
from bilayer_core.studies.sweeps.metrics import FinishedRun
from bilayer_core.studies.sweeps.optimise import CONFIRMED, finer_job, start_of
from bilayer_core.studies.sweeps.run_sweep import read_sweep
from bilayer_core.studies.sweeps.sweep_functions import load
from bilayer_core.verification.validate.closed_forms import timoshenko

ROUNDING = 1e-5
"""To which the walker's scene file gives lengths [m] and directions."""
WALK = {
    "period": 0.6089047137865468,
    "rise": 0.3018429842859414,
    "wettest": 0.8663821466207916,
    "hip": 48.84822465472758,
}
BEAT = {"period": 0.457463, "lit": 0.628033}
"""The fastest gaits of `bilayer optimise`, by docs/designs.md."""


def row_of(job, parameters):
    """The row of one run."""
    (row,) = execute(job, [Point(0, "key", parameters)])
    assert row.outcome is Outcome.DONE, row.reason
    return row


def leaves(content, path=""):
    """Every single value of a content by its key path."""
    if isinstance(content, dict | list):
        for key, value in content.items() if isinstance(content, dict) else enumerate(content):
            yield from leaves(value, f"{path}.{key}")
    else:
        yield path, content


def changed_walker(read, **parameters):
    """Content of the walker as the sweep's function changes it."""
    content = scene_content(load_scene("crawling_dual_leg"))
    return load(read.job.codes[read.job.change])(content, read.job.in_si(start_of(read) | parameters))


@pytest.mark.parametrize("name", sorted(bundled_sweeps()))
def test_the_first_and_the_last_run_of_a_bundled_sweep_can_be_built(name):
    read = read_sweep(name)
    points = list(read.points())
    for point in (points[0], points[-1]):
        assert Simulator(scene_of(read.job, point.parameters)).model.node_count > 1
    assert read.spec.title and read.job.metrics


@pytest.mark.slow
def test_the_map_of_curvatures_is_that_of_timoshenkos_formula():
    read = read_sweep("timoshenko")
    rows = execute(read.job, [point for point in read.points() if point.number % 6 == 0])
    assert len({row.parameters["m"] for row in rows}) > 10 and len({row.parameters["n"] for row in rows}) == 7
    for row in rows:
        assert row.metrics["curvature"] == pytest.approx(timoshenko(**row.parameters), rel=1e-11)
        assert abs(row.metrics["error"]) < 1e-11


def test_the_walkers_own_values_leave_its_robot_as_it_is():
    read = read_sweep("walker_gait")
    own, changed = (dict(leaves(c)) for c in (scene_content(load_scene("crawling_dual_leg")), changed_walker(read)))
    apart = {"duration", "schedule"}
    kept = [{path: value for path, value in of.items() if not apart & set(path.split("."))} for of in (own, changed)]
    assert kept[0].keys() == kept[1].keys() and len(kept[0]) > 200
    for path, value in kept[0].items():
        if isinstance(value, float):
            assert kept[1][path] == pytest.approx(value, abs=ROUNDING), path
        else:
            assert kept[1][path] == value, path


def test_the_walkers_own_values_give_its_own_humidity():
    read = read_sweep("walker_gait")
    own, changed = Simulator(load_scene("crawling_dual_leg")), Simulator(load_content(changed_walker(read), {}))
    assert start_of(read)["period"] == own.scene.stimuli["humidity"].schedule.period
    for until in (0.3, 0.9, 1.2, 1.7):
        own.run(until=until), changed.run(until=until)
        assert changed.stimulus["humidity"] == pytest.approx(own.stimulus["humidity"], abs=1e-12)
        assert 0.05 < own.stimulus["humidity"] < 1.0 + 1e-12


def ends(rod):
    """Start and end of a path that is straight or an arc which curves up [m]."""
    path = rod["path"]
    start, direction = np.array(path["start"]), np.array(path["direction"]) / np.linalg.norm(path["direction"])
    if path["shape"] == "straight":
        return start, start + path["length"] * direction
    across, angle = np.array([-direction[2], 0.0, direction[0]]), path["angle"]
    return start, start + path["radius"] * (math.sin(angle) * direction + (1.0 - math.cos(angle)) * across)


def walker(content):
    """Rods and bodies of the walker by name."""
    return {of["name"]: of for of in (*content["rods"], *content["bodies"])}


@pytest.mark.parametrize("hip", [30.0, 36.5, 49.0])
def test_another_place_of_the_hind_leg_leaves_the_ribbon_and_the_ground_where_they_are(hip):
    content = changed_walker(read_sweep("walker_gait"), hip=hip)
    assert Simulator(load_content(copy.deepcopy(content), {})).model.node_count > 80
    own, moved = walker(scene_content(load_scene("crawling_dual_leg"))), walker(content)
    (tip, joint), (begin, shoulder) = ends(moved["tail"]), ends(moved["trunk"])
    assert tip == pytest.approx(ends(own["tail"])[0], abs=ROUNDING)
    assert shoulder == pytest.approx(ends(own["trunk"])[1], abs=ROUNDING)
    assert joint == pytest.approx(begin, abs=ROUNDING)
    assert moved["hip"]["position"] == pytest.approx(begin, abs=ROUNDING)
    assert math.degrees(math.atan2(-begin[0], 0.112 - begin[2])) == pytest.approx(hip, abs=0.01)
    assert np.dot(moved["trunk"]["normal"], moved["trunk"]["path"]["direction"]) == pytest.approx(0.0, abs=1e-12)
    grown = moved["tail"]["layers"][1]["interval"]
    assert grown == pytest.approx([0.0207, 0.1 * math.radians(65.0 - hip)], abs=ROUNDING)
    (top, bottom), (old_top, old_bottom) = ends(moved["hind_leg"]), ends(own["hind_leg"])
    assert top - begin == pytest.approx(old_top - ends(own["trunk"])[0], abs=ROUNDING)
    assert bottom[2] == pytest.approx(old_bottom[2], abs=ROUNDING)
    for name in ("hind_ankle", "hind_foot"):
        place, old = (np.array(of[name].get("position") or of[name]["path"]["start"]) for of in (moved, own))
        assert place - bottom == pytest.approx(old - old_bottom, abs=ROUNDING)
    lengths = [ends(of[name])[1] - ends(of[name])[0] for of in (own, moved) for name in ("tail", "trunk", "hind_leg")]
    edges = [of[name]["stations"] - 1 for of in (own, moved) for name in ("tail", "trunk", "hind_leg")]
    spacing = [np.linalg.norm(length) / count for length, count in zip(lengths, edges, strict=True)]
    assert spacing[3:] == pytest.approx(spacing[:3], rel=0.1)


@pytest.mark.verify
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("name", "best", "least"), [("walker_gait", WALK, 1.3), ("swimmer_gait", BEAT, 1.3)])
def test_the_gait_that_was_found_is_faster_and_finer_steps_and_meshes_say_so(name, best, least):
    read = read_sweep(name)
    start, found = (row_of(read.job, values).metrics["speed"] for values in (start_of(read), best))
    assert found > least * start > 0.0
    assert row_of(finer_job(read.job, best), best).metrics["speed"] == pytest.approx(found, rel=CONFIRMED)
    content = scene_content(scene_of(read.job, best))
    for rod in content["rods"]:
        rod["stations"] = 2 * rod["stations"] - 1
    simulator = Simulator(load_content(content, {}))
    recording = Recorder(simulator, list(read.job.quantities), read.job.rate)
    simulator.run()
    run = FinishedRun(simulator, simulator.summary(), best, recording)
    speed = load(read.job.codes[read.job.metrics["speed"].function])(run)
    assert speed == pytest.approx(found, rel=CONFIRMED)


@pytest.mark.slow
@pytest.mark.parametrize(("length", "holds"), [(52.0, False), (56.0, True)])
def test_a_gripper_that_holds_by_the_map_lifts_the_free_ball_and_no_other_does(length, holds):
    read, parameters = read_sweep("gripper_map"), {"gain": 6.0, "length": length}
    row = row_of(read.job, parameters)
    assert (row.metrics["holding_force"] is not None) is holds
    content = copy.deepcopy(scene_content(scene_of(read.job, parameters)))
    own = scene_content(load_scene("gripping"))
    for body, free in zip(content["bodies"], own["bodies"], strict=True):
        body["motion"] = free["motion"]
    simulator = Simulator(load_content(content, {}))
    simulator.run()
    lift = simulator.summary()["bodies"]["ball"]["lift_end"]
    assert lift > 0.07 if holds else lift < 0.01
