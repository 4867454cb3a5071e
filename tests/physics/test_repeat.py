"""Two runs are the same bit for bit, in one process and in several, in one piece, in parts and from saved states."""

import json
import random
import subprocess
import sys

import numpy as np
import pytest
from support.crowded_scenes import COMBINATIONS, DT, DURATION, crowded, crowded_simulator
from support.moving_scenes import part
from support.processes import TIMEOUT, environment
from support.repeats import assert_goes_on, differences, figures, follow

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.energy_account import ENERGY, LOWEST, OPEN
from bilayer_core.log.run.state_file import read_saved_state, write_state
from bilayer_core.scene.bundled import bundled_scenes

QUICK = COMBINATIONS[::7]
EACH = pytest.mark.parametrize(
    "chosen",
    [pytest.param(c, marks=() if c in QUICK else pytest.mark.verify, id="-".join(map(str, c))) for c in COMBINATIONS],
)
QUICK_SCENES = ("flagellum", "steered_walker")
SCENES = pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK_SCENES else pytest.mark.verify) for n in bundled_scenes()]
)
LOOSE = 3e-3
"""Newton's tolerance with which a last correction moves what touches, and the energy, by much [m/s]."""


def interfere(simulator, number):
    """Set a stimulus, a load and a pose from outside before some steps, at times several at once."""
    chance = random.Random(number)
    if chance.random() < 0.2:
        simulator.set_stimulus("humidity", chance.choice([0.1, 0.9, None]))
    if chance.random() < 0.2:
        simulator.set_load("tug", chance.choice([0.0, 2.0, None]))
    if chance.random() < 0.2:
        simulator.set_pose("hub", [chance.uniform(-1e-3, 1e-3), 0.0, 0.0425], over=0.01)


@pytest.mark.verify  # of what is not interfered with, which is less
@pytest.mark.parametrize("chosen", COMBINATIONS, ids=lambda chosen: "-".join(map(str, chosen)))
def test_a_run_goes_on_bit_for_bit_from_any_step(chosen):
    simulator = assert_goes_on(lambda: crowded_simulator(*chosen), 0.6 * DURATION)
    assert {"joints", "barrier", "friction"} <= set(simulator.model.forces)


@EACH
def test_a_run_that_is_interfered_with_goes_on_bit_for_bit(chosen):
    assert_goes_on(lambda: crowded_simulator(*chosen, newton_tolerance=LOOSE), 0.4 * DURATION, act=interfere)


def test_contacts_that_friction_spread_in_one_step_leave_nothing_to_the_next():
    scene = load_scene("crawling_film")
    assert_goes_on(lambda: Simulator(scene), 0.4, every=1, fresh_every=100, steps=2)


@SCENES
def test_bundled_scenes_go_on_bit_for_bit(name):
    scene = load_scene(bundled_scenes()[name])
    assert_goes_on(lambda: Simulator(scene), 0.05, every=8, fresh_every=16, steps=3)
    assert_goes_on(lambda: Simulator(scene, dt=2e-3), 0.03, every=6, fresh_every=12, steps=3)


@EACH
def test_a_run_in_parts_that_is_watched_is_the_run_in_one_piece(chosen):
    whole = crowded_simulator(*chosen)
    whole.run()
    in_parts, by_steps = crowded_simulator(*chosen), crowded_simulator(*chosen)
    for end in np.linspace(0.0, DURATION, 5)[1:]:
        in_parts.run(until=DURATION, stop=lambda: in_parts.time >= end, each_step=lambda _: figures(in_parts))  # noqa: B023
    while by_steps.time < DURATION - (0.5 * DT if "fixed" in chosen else 0.0):
        by_steps.step(DURATION)
    in_account = crowded_simulator(*chosen, budget=True)
    in_account.run()
    for other in (in_parts, by_steps, in_account):
        assert differences(other, whole.save_state(), figures(whole)) == []


def test_a_saved_state_keeps_its_account_of_energy_to_the_last_bit():
    chosen = ("laminate", 3, "implicit_euler", "adaptive")
    simulator = crowded_simulator(*chosen, newton_tolerance=LOOSE)
    _, states, _ = follow(simulator, 0.6 * DURATION)
    kept = 0
    for state in states:
        simulator.load_state(state)
        account = simulator.energy_account
        assert differences(simulator, state) == []
        kept += account[LOWEST] < 0.0
    assert kept > 5  # accounts that begin anew have 0 there


def test_a_state_that_someone_has_changed_has_a_new_account_of_energy():
    chosen = ("laminate", 3, "implicit_euler", "fixed")
    simulator = crowded_simulator(*chosen)
    simulator.run(0.02)
    state, velocity = simulator.save_state(), part(simulator, "velocity").copy()
    simulator.load_state(state)
    own = simulator.energy_account
    begin = 0
    for name, shape in simulator._state.layout():
        if name == "velocity":
            state[begin : begin + velocity.size] *= 2.0
        begin += int(np.prod(shape))
    simulator.load_state(state)
    changed = simulator.energy_account
    assert own[LOWEST] < 0.0 and changed[LOWEST] == 0.0
    assert changed[ENERGY] > own[ENERGY] and changed[OPEN] == own[OPEN] == 1.0


def test_a_state_file_holds_the_bits_of_a_state(tmp_path):
    simulator = crowded_simulator(*COMBINATIONS[0])
    simulator.run(0.01)
    simulator.set_stimulus("humidity", 0.3)
    state, description = simulator.save_state(), simulator.description
    write_state(tmp_path / "state.npz", state, description)
    assert read_saved_state(tmp_path / "state.npz", description).tobytes() == state.tobytes()


PROGRAM = """
import hashlib, json, sys
import numpy as np
from support.crowded_scenes import COMBINATIONS, DT, crowded_simulator
from bilayer_core import Simulator, load_scene
from bilayer_core.scene.bundled import bundled_scenes

def digest(simulator):
    for _ in range(8):
        simulator.step()
    return hashlib.sha256(simulator.save_state().tobytes()).hexdigest()

def digests(chosen, scenes):
    found = {"-".join(map(str, c)): digest(crowded_simulator(*c)) for c in chosen}
    return found | {name: digest(Simulator(load_scene(bundled_scenes()[name]))) for name in scenes}
"""


def digests_elsewhere(folder, chosen, scenes, **more):
    """Digests of states after some steps in another process."""
    program = PROGRAM + f"\nprint(json.dumps(digests({chosen!r}, {scenes!r})))"
    return json.loads(
        subprocess.run(
            [sys.executable, "-P", "-c", program],
            env={**environment(), **more},
            cwd=folder,
            capture_output=True,
            text=True,
            check=True,
            timeout=TIMEOUT,
        ).stdout
    )


@pytest.mark.parametrize(
    ("chosen", "scenes"),
    [
        (QUICK, list(QUICK_SCENES)),
        pytest.param(COMBINATIONS, [n for n in bundled_scenes() if n != "knot"], marks=pytest.mark.verify),
    ],
    ids=["some", "all"],
)
def test_other_processes_threads_seeds_folders_and_runs_before_change_nothing(chosen, scenes, tmp_path):
    here = {}
    exec(PROGRAM, here)  # noqa: S102 (the same program, in this process)
    other = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "PYTHONHASHSEED"), "1")
    first = here["digests"](chosen, scenes)
    assert digests_elsewhere(tmp_path, chosen[::-1], scenes[::-1], **other) == first


def test_gaps_of_near_pairs_are_those_of_the_present_list():
    content = crowded(3)
    content["bodies"][1]["motion"]["velocity"] = [0.0, 0.0, -2.0]
    simulator = Simulator(load_scene(content), model="laminate", dimension=3, integrator="sdirk2", tolerance=1e-2)
    listed = 0
    while simulator.time < 0.02:
        simulator.step(0.02)
        surfaces, end = simulator._stepper.engine._storage.problem.surfaces, simulator._stepper.engine.end
        for k in range(surfaces.near_count[0]):
            i, s = surfaces.near_contact_point[k], surfaces.near_surface[k]
            if surfaces.kind[s] == 0 and not surfaces.near_arm[k]:  # the ground
                gap = end.contact_point[i, 2] - surfaces.radius[i]
                assert surfaces.near_gap[k] == pytest.approx(gap, abs=2e-5)
                listed += 1
    assert listed > 100
