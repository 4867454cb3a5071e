"""Pareto fronts, costs, errors of trajectories, slopes."""

import math
import os
from pathlib import Path

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.verification.bench import pareto, scaling, start
from bilayer_core.verification.bench.configurations import Family
from bilayer_core.verification.bench.independent import SplineRod
from bilayer_core.verification.bench.track import Track, Trajectory, rms_distance
from bilayer_core.verification.validate.closed_forms import FIRST_MODE, heavy_cantilever

LEAN, RICH = Family("lean", 3, "sdirk2"), Family("rich", 3, "sdirk2")


def record(family, problem, cost, error, outcome="done"):
    return {**vars(family), "problem": problem, "cpu_time": cost, "error": error, "outcome": outcome}


def test_on_the_front_nothing_is_both_dearer_and_worse():
    points = [(1.0, 0.1), (2.0, 0.2), (3.0, 0.05), (3.0, 0.04), (0.5, 0.5), (9.0, 0.04)]
    assert pareto.front(points) == [4, 0, 3]


def test_runs_without_a_result_are_never_the_cheapest():
    runs = [record(LEAN, "a", 1.0, None, "unstable"), record(LEAN, "a", 2.0, 0.01), record(LEAN, "a", 3.0, 1e-4)]
    assert pareto.cheapest(runs, 0.01)["cpu_time"] == 2.0
    assert pareto.cheapest(runs, 1e-5) is None


def test_the_family_that_is_cheapest_on_the_whole_is_recommended():
    runs = [record(LEAN, "a", 1.0, 0.01), record(RICH, "a", 2.0, 0.001)]
    runs += [record(LEAN, "b", 1.0, 0.01), record(RICH, "b", 0.9, 0.001)]
    assert pareto.recommended(runs) == LEAN
    scores = pareto.scores(pareto.costs(runs))
    assert scores[LEAN] == pytest.approx(math.sqrt(1.0 / 0.9)) and scores[RICH] == pytest.approx(math.sqrt(2.0))


def test_a_family_that_misses_the_aim_pays_for_it():
    runs = [record(LEAN, "a", 0.1, 0.5), record(RICH, "a", 2.0, 0.001)]
    assert pareto.recommended(runs) == RICH


def test_a_family_that_a_scene_refuses_is_judged_by_that_of_the_other_dimension():
    flat = Family("lean", 2, "sdirk2")
    runs = [record(flat, "a", 0.5, 0.01), record(LEAN, "a", 1.0, 0.01), record(RICH, "a", 3.0, 0.01)]
    runs += [record(LEAN, "b", 1.0, 0.01), record(RICH, "b", 3.0, 0.01)]
    assert pareto.recommended(runs) == flat


def test_where_a_scene_refuses_a_dimension_the_same_in_the_other_stands_in():
    flat = Family("lean", 2, "sdirk2")
    assert pareto.stand_in(flat, [RICH, LEAN, flat]) == flat
    assert pareto.stand_in(flat, [RICH, LEAN]) == LEAN
    assert pareto.stand_in(flat, [RICH]) is None


def test_the_distance_of_two_ways_is_their_root_mean_square():
    times = np.linspace(0.0, 1.0, 201)
    way = np.column_stack([times, np.cos(times), np.zeros(201), np.sin(times)])
    shifted = way[::7] + [0.0, 0.3, 0.0, -0.4]
    assert rms_distance(shifted, way) == pytest.approx(0.5)
    between = 0.5 * (way[:-1, 0] + way[1:, 0])
    exact = np.column_stack([between, np.cos(between), 0 * between, np.sin(between)])
    assert rms_distance(exact, way) < 1e-9  # the reference between its instants


def test_a_trajectory_counts_until_its_end_alone_whatever_the_steps():
    simulator = Simulator(load_scene("cantilever", ["rods.strip.stations=6"]), tolerance=1e-4)
    track = Track(simulator)
    measure = Trajectory("tip", until=0.011, spacing=1e-3, length=0.1)
    for end in (*measure.stops, 0.02):
        simulator.run(end - simulator.time, each_step=track.look)
    found = measure.values(track)
    assert found[0, 0] == 0.0 and found[-1, 0] == pytest.approx(0.011, abs=1e-12)
    assert len(found) < len(track.times)
    np.testing.assert_array_equal(track.at("tip", 1.0), simulator.positions[5])


def test_each_instant_of_a_way_weighs_as_its_time():
    times = np.array([0.0, 0.1, 0.2, 0.3, 1.0])
    way = np.column_stack([times, np.zeros((5, 3))])
    found = way + np.array([0.0, 1.0, 0.0, 0.0])
    found[:4, 1] = 0.0
    assert rms_distance(found, way) == pytest.approx(math.sqrt(0.5 * 0.7))


def test_the_slope_of_times_that_grow_with_a_power_is_the_power():
    records = [{"model": "m", "dimension": 3, "nodes": n, "cpu_time": 2e-6 * n**1.3} for n in (50, 200, 800)]
    assert scaling.slopes(records) == {("m", 3): pytest.approx(1.3)}
    records[0]["cpu_time"] *= 10.0
    assert scaling.slopes(records)["m", 3] < 1.0
    assert scaling.slopes(records, 200) == {("m", 3): pytest.approx(1.3)}


def test_the_independent_rod_swings_with_a_cantilevers_frequency():
    length, axial, bending, mass, gravity = 0.1, 2.0, 6.6667e-6, 0.02, 9.81e-3
    rod = SplineRod(length, axial, bending, mass, 4, gravity=gravity)
    frequency = FIRST_MODE**2 * math.sqrt(bending / (mass * length**4))
    period = 2.0 * math.pi / frequency
    times = np.linspace(0.0, period, 41)
    z = rod.integrate(times)[0][:, 1]
    sag = heavy_cantilever(mass * gravity, bending, axial, length)[1]
    # released from straight: swings about the equilibrium, by other modes as well (up to 3 %)
    assert z[20] == pytest.approx(2.0 * sag, rel=0.04)
    assert abs(z[-1]) < 0.05 * abs(sag)


def test_the_force_of_the_independent_rod_is_the_slope_of_its_energy():
    rod = SplineRod(0.1, 20.0, 6.67e-6, 0.02, 5, gravity=9.81, force=lambda t: 0.3, moment=lambda t: 1e-4)

    def energy(c):
        a, b = rod._first @ c, rod._second @ c
        size = np.linalg.norm(a, axis=1)
        chi = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / size**2
        density = 0.5 * 20.0 * (size - 1.0) ** 2 - 0.3 * (size - 1.0) + 0.5 * 6.67e-6 * chi**2 + 1e-4 * chi
        height = rod._value @ c[:, 1]
        return rod.weight @ (density + 0.02 * 9.81 * height)

    rng = np.random.default_rng(3)
    at = rod.start + 2e-3 * rng.standard_normal(rod.start.shape)
    direction = rng.standard_normal(at.shape)
    slope = (energy(at + 1e-8 * direction) - energy(at - 1e-8 * direction)) / 2e-8
    assert slope == pytest.approx(-np.sum(rod.potential_force(at, 0.0) * direction), rel=1e-6)


@pytest.mark.verify
def test_a_start_takes_at_least_the_cpu_time_of_its_kernels_and_imports():
    found = start.first_step("cantilever", "laminate", 2, Path(os.environ["NUMBA_CACHE_DIR"]))
    assert found["compile_time"] < found["cpu_time"] and found["import_time"] < found["wall_time"]
