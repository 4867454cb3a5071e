"""Arrays for what varies in number: they begin small, grow with what a run needs, and end before memory does."""

import tracemalloc

import numpy as np
import pytest
from support.sample_scenes import GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine import capacity, storage
from bilayer_core.errors import PenetrationError, SceneError, SimulationError
from bilayer_core.model import rod_surfaces, start_gaps
from bilayer_core.model.build_model import build_model
from bilayer_core.model.records.status import PAIR_CAPACITY_EXCEEDED
from bilayer_core.verification.stress.all_cases import all_cases


def falling(thickness=1e-3, gap=2.5e-3, **more):
    """A strip that falls onto another one, which is held at both ends."""
    lower = rod([layer(thickness=thickness)], name="lower") | {"clamp_start": "left", "clamp_end": "right"}
    upper = rod([layer(thickness=thickness)], start=(0, 0, gap), name="upper")
    bodies = [fixed("left", (0, 0, 0)), fixed("right", (0.1, 0, 0))]
    return scene([lower, upper], gravity=[0, 0, -10.0], bodies=bodies, contact=contact(coefficient=0.3), **more)


def on_two_grounds():
    """A strip on two planes, so that more pairs are near than it has points."""
    grounds = [GROUND, GROUND | {"name": "second"}]
    return scene([rod([layer()], start=(0, 0, 2e-3))], gravity=[0, 0, -10.0], obstacles=grounds, contact=contact())


LIMITS = {
    "contacts": (falling, "MOST_CONTACTS", 5, "points of rods touch other rods, at most 5 are computed"),
    "pairs": (falling, "MOST_PAIRS", 5, "points of rods are near other rods, at most 5 are computed"),
    "columns": (falling, "LARGEST_BORDER", 3e3, "unknowns belong to edges of rods that touch, at most"),
    "surfaces": (on_two_grounds, "MOST_SURFACE_PAIRS", 5, "points are near surfaces, at most 5 are computed"),
}


@pytest.mark.parametrize("name", LIMITS)
def test_a_run_that_needs_more_than_the_limit_stops_and_says_why(name, monkeypatch):
    content, limit, value, reason = LIMITS[name]
    monkeypatch.setattr(capacity, limit, value)
    monkeypatch.setattr(storage, "FIRST_POINTS", 0)
    monkeypatch.setattr(storage, "PAIRS_PER_POINT", 0)
    simulator = Simulator(load_scene(content()))
    with pytest.raises(SimulationError, match=reason) as refusal:
        simulator.run(0.1)
    assert refusal.value.time == simulator.time < 0.1
    assert str(refusal.value.remedy) in str(refusal.value)
    assert np.isfinite(simulator.positions).all() and np.isfinite(list(simulator.energy().values())).all()


@pytest.mark.parametrize("limit", ["MOST_CONTACTS", "MOST_PAIRS"])
def test_the_remedy_of_too_many_contacts_works(limit, monkeypatch):
    monkeypatch.setattr(capacity, limit, 5)
    monkeypatch.setattr(storage, "FIRST_POINTS", 0)
    with pytest.raises(SimulationError) as refusal:
        Simulator(load_scene(falling())).run(0.05)
    simulator = Simulator(load_scene(falling(), refusal.value.remedy.overrides()))
    simulator.run(0.05)
    assert simulator.time == pytest.approx(0.05)


def test_what_a_run_computes_does_not_depend_on_the_capacity_that_it_begins_with(monkeypatch):
    states = []
    for first in (0, 10_000):
        monkeypatch.setattr(storage, "FIRST_POINTS", first)
        simulator = Simulator(load_scene(falling()))
        simulator.run(0.05)
        states.append(simulator.positions.tobytes() + simulator.velocities.tobytes())
    assert simulator.frame().min_gap < 1e-3 and states[0] == states[1]


@pytest.mark.parametrize("name", ["all/1316", "all/1530"])
def test_arrays_of_the_thinnest_strips_of_the_stress_matrix_are_small(name):
    found = load_scene(all_cases()[name].scene())
    model = build_model(found, found.solver.model, found.solver.dimension)
    assert len(model.rod_search.point_edge) > 800_000
    tracemalloc.start()
    arrays = storage.Storage(model)
    _ = arrays.problem
    arrays.grow(PAIR_CAPACITY_EXCEEDED)
    largest = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert largest < 100e6  # more than 1 and 3 GB when there was capacity for as many contacts as points


@pytest.mark.parametrize("thickness", [1e-8, 1e-30])
def test_a_rod_too_thin_for_contact_is_refused_before_memory_is_asked_for(thickness):
    thin = load_scene(falling(thickness=thickness))
    tracemalloc.start()
    with pytest.raises(SceneError, match=r"rods\.(lower|upper): must be thicker or shorter.*allowed are 5000000"):
        build_model(thin)
    largest = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert largest < 10e6
    build_model(load_scene(falling(thickness=thickness), ["contact.rods=false"]))


def test_the_limit_of_points_is_on_those_of_all_rods_together(monkeypatch):
    count = len(build_model(load_scene(falling())).rod_search.point_edge)
    monkeypatch.setattr(rod_surfaces, "MOST_POINTS", count)
    build_model(load_scene(falling()))
    monkeypatch.setattr(rod_surfaces, "MOST_POINTS", count - 3)
    with pytest.raises(SceneError, match="must be thicker or shorter"):
        build_model(load_scene(falling()))


def test_rods_that_start_in_each_other_at_many_places_are_refused(monkeypatch):
    messages = []
    for most in (1_000_000, 5):
        monkeypatch.setattr(start_gaps, "MOST_SHOWN", most)
        with pytest.raises(PenetrationError, match="the scene starts in penetration") as refusal:
            Simulator(load_scene(falling(gap=0.5e-3)))
        messages.append(str(refusal.value))
    assert "mm inside" in messages[1]
