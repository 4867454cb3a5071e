"""Rods that touch each other and themselves, in whole runs; and which of them can."""

import numpy as np
import pytest
from support.sample_scenes import GEL, GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import PenetrationError
from bilayer_core.testing import run_scene
from bilayer_core.testing.gaps import GapCheck

D_HAT = 1e-3
FLAT = " (as flat ribbons with borders)"


def stacked(lower_stations, upper_stations, width=0.01, thickness=2e-3):
    """A rod on another one of the same length on the ground; barriers soft enough for both to stay straight."""
    lower = rod([layer(thickness=2e-3)], stations=lower_stations, start=(0, 0, 1.9e-3), name="lower", width=width)
    start = (0, 0, 3.8e-3 + 0.5 * thickness)
    upper = rod([layer(thickness=thickness)], stations=upper_stations, start=start, name="upper", width=width)
    soft = contact(coefficient=0.5) | {"stiffness": 1e4}
    return scene([lower, upper], gravity=[0, 0, -10.0], obstacles=[GROUND], contact=soft, damping={"mass": 60.0})


@pytest.mark.parametrize("stations", [(11, 12), (21, 38), (81, 55)])
@pytest.mark.parametrize(("width", "thickness"), [(0.01, 2e-3), (2e-3, 1e-3)], ids=["ribbons", "round"])
def test_parallel_rods_rest_at_the_gap_that_the_barrier_demands_on_any_meshes(stations, width, thickness):
    simulator = Simulator(load_scene(stacked(*stations, width, thickness)))
    simulator.run(0.3)
    upper = simulator.model.strands[1].first_node
    heights, weights = simulator.positions[:, 2], simulator.model.node_length
    gap = np.average(heights[upper:], weights=weights[upper:])
    gap -= np.average(heights[:upper], weights=weights[:upper]) + 1e-3 + 0.5 * thickness
    s = gap - D_HAT
    weight = 1e4 * width * thickness  # N/m
    assert 1e4 * (2.0 * s * np.log(gap / D_HAT) + s * s / gap) == pytest.approx(weight, rel=1e-3)
    total = simulator.contact_forces
    assert total[upper:].sum(axis=0) == pytest.approx([0, 0, weight * 0.1], rel=1e-5, abs=1e-7)
    both = 1e4 * width * (thickness + 2e-3) * 0.1
    assert total.sum(axis=0) == pytest.approx([0, 0, both], rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("speed", [0.5, 20.0])
def test_a_ribbon_that_falls_across_the_middle_of_another_does_not_pass(speed):
    lower = rod([layer()], stations=6, length=0.05, start=(-0.025, 0, 0), name="lower")
    lower |= {"clamp_start": "left", "clamp_end": "right"}
    upper = rod([layer()], stations=6, length=0.05, start=(0, -0.025, 0.02), name="upper")
    upper["path"]["direction"] = [0, 1, 0]
    crossing = scene(
        [lower, upper],
        bodies=[fixed("left", (-0.025, 0, 0)), fixed("right", (0.025, 0, 0))],
        contact=contact(coefficient=0.3),
    )
    simulator = Simulator(load_scene(crossing))
    upper_nodes = slice(6, 12)
    simulator._state.velocity[upper_nodes, 2] = -speed
    lowest, smallest = np.inf, np.inf
    for _ in range(round(0.05 / simulator.dt)):
        simulator.step()
        middle = simulator.positions[8:10, 2].mean() - simulator.positions[2:4, 2].mean()
        lowest = min(lowest, middle)
        smallest = min(smallest, simulator.frame().min_gap)
    assert smallest < D_HAT  # they met
    # points of a rod are half a thickness apart: centrelines of two crossing ones stay this far apart
    assert lowest > np.sqrt(1e-3**2 - 0.25e-3**2)


@pytest.mark.parametrize("speed", [0.5, 20.0])
@pytest.mark.parametrize("direction", [(1, 0, 0), (1, 0.5, 0)], ids=["edge to edge", "corner first"])
def test_a_ribbon_thrown_sideways_at_the_edge_of_another_does_not_pass(speed, direction):
    held = rod([layer()], stations=6, length=0.05, start=(-0.025, 0, 0), name="held", clamp_start="wall")
    thrown = rod([layer()], stations=6, length=0.05, start=(-0.02, 0.02, 0), name="thrown")
    thrown["path"]["direction"] = list(direction)
    meeting = scene(
        [held, thrown], bodies=[fixed(position=(-0.025, 0, 0))], contact=contact(2e-4), solver={"model": "laminate"}
    )
    simulator = Simulator(load_scene(meeting))
    judge, smallest = GapCheck(simulator.model), np.inf
    simulator._state.velocity[6:, 1] = -speed
    for _ in range(round(0.04 / speed / simulator.dt) + 20):
        simulator.step()
        moment = judge.moment(simulator.frame())
        smallest = min(smallest, judge.smallest(moment))
        assert judge.crossed(moment) == ""
    assert -judge.unsure < smallest < 2e-4  # they met


@pytest.mark.parametrize("model", ["laminate", pytest.param("two_rod", marks=pytest.mark.verify)])
def test_linked_rings_of_unlike_layers_hang_in_each_other_with_their_faces(model):
    unlike, rings = [layer("outer"), layer("inner", thickness=2e-4, material="paper")], []
    for name, start, along, inward in (
        ("held", (0, 0, 0.015), (1, 0, 0), (0, 0, -1)),
        ("hung", (0.03, 0, 0), (0, 1, 0), (-1, 0, 0)),
    ):
        arc = {"shape": "arc", "start": start, "direction": along, "radius": 0.015, "angle": "360 deg", "closed": True}
        rings.append(rod(unlike, stations=41, name=name, width=5e-3, normal=list(inward)) | {"path": arc})
    content = scene(
        rings,
        contact=contact(2e-4),
        damping={"mass": 5.0},
        gravity=[0, 0, -9.81],
        obstacles=[{"name": "ground", "type": "plane", "point": [0, 0, -0.02], "normal": [0, 0, 1]}],
        materials={"gel": GEL, "paper": {**GEL, "youngs_modulus": 1e8}},
        solver={"dt": None},
    )
    run = run_scene(content, 0.1, model=model)
    run.assert_sound()
    assert 0.0 < run.smallest_gap < 2e-4


def curling(stations=46, **more):
    """A bilayer with a straight tail that would curl up by more than a turn, in the air."""
    active = layer("active", eigenstrain={"stimulus": "heat", "gain": 0.06, "interval": [0.04, 0.2]})
    return scene(
        [rod([layer("passive"), active], length=0.2, stations=stations)],
        stimuli={"heat": {"schedule": {"type": "ramp", "start": 0, "end": 0.1, "from": 0, "to": 1}}},
        damping={"mass": 100.0},
        **more,
    )


def least_distance(simulator):
    """Of points on one layer from others on it that are a quarter of the strip away or more."""
    count = simulator.model.strands[0].node_count
    nodes = simulator.positions[:count]
    part = np.linspace(0, count - 1, 20 * count)
    line = np.stack([np.interp(part, np.arange(count), nodes[:, c]) for c in range(3)], axis=1)
    distance = np.linalg.norm(line[:, None] - line[None], axis=2)
    return distance[np.abs(np.subtract.outer(part, part)) > 0.25 * count].min()


def test_a_bilayer_that_curls_up_closes_on_itself_and_does_not_pass_through_itself():
    closed = Simulator(load_scene(curling(contact=contact())))
    free = Simulator(load_scene(curling(contact={**contact(), "rods": False})))
    nearest = {True: np.inf, False: np.inf}
    for _ in range(15):
        for simulator in (closed, free):
            simulator.run(0.01)
            nearest[simulator is closed] = min(nearest[simulator is closed], least_distance(simulator))
    assert closed.statistics.min_gap < D_HAT
    assert closed.summary()["converged"] is True
    assert nearest[False] < 0.1e-3  # passes through itself
    assert nearest[True] > 1e-3


def test_ribbons_that_collide_in_flight_keep_their_momentum_and_slow_down_by_friction():
    lower = rod([layer("bottom"), layer("top")], stations=12, length=0.05, name="lower")
    upper = rod([layer()], stations=9, length=0.04, start=(0.003, 0, 4e-3), name="upper")
    flight = scene(
        [lower, upper], contact=contact(coefficient=0.5, speed_threshold=1e-2), solver={"newton_tolerance": 1e-10}
    )
    simulator = Simulator(load_scene(flight))
    nodes = simulator.model.strands[-1].first_node
    simulator._state.velocity[nodes:] = [0.3, 0.1, -0.5]
    mass = simulator.model.rods.node_mass
    before = mass @ simulator.velocities
    relative = simulator.velocities[nodes, 0]
    simulator.run(0.05)
    after = mass @ simulator.velocities
    exchanged = np.abs(before).sum()
    assert simulator.statistics.min_gap < D_HAT
    assert np.abs(after - before).max() < 1e-9 * exchanged
    parts = (slice(nodes), slice(nodes, None))
    mean = [np.average(simulator.velocities[part, 0], weights=mass[part]) for part in parts]
    assert abs(mean[1] - mean[0]) < 0.9 * relative


def test_a_run_with_rods_in_contact_continues_bit_for_bit_from_a_saved_state():
    description = curling(contact=contact(coefficient=0.5))
    whole = Simulator(load_scene(description))
    whole.run(0.12)
    saved = whole.save_state()
    whole.run(0.02)
    assert whole.frame().min_gap < D_HAT
    other = Simulator(load_scene(description))
    other.load_state(saved)
    other.run(0.02)
    assert np.array_equal(other.save_state(), whole.save_state(), equal_nan=True)
    assert np.array_equal(other.contact_forces, whole.contact_forces)
    assert np.abs(whole.contact_forces).max() > 0.0
    assert whole.energy()["rod barrier"] > 0.0


def test_rods_that_start_in_each_other_are_refused_by_name():
    rods = [rod([layer()], name="a"), rod([layer("skin")], name="b", start=(0.013, 0, 0.6e-3))]
    with pytest.raises(PenetrationError, match=r"node \d+ of [ab]/\w+ is 0\.4 mm inside node \d+ of [ab]/\w+"):
        Simulator(load_scene(scene(rods, contact=contact())))


def test_contact_of_rods_is_left_out_where_geometry_excludes_it_and_the_plan_says_why():
    def plan_of(rods, **more):
        return Simulator(load_scene(scene(rods, **{"contact": contact(coefficient=0.3), **more}))).plan

    short = plan_of([rod([layer()])])
    assert short.terms["rod barrier"].startswith("skipped: turns by 0° at most")
    walls = [fixed("left"), fixed("right", (0, 0, 1))]
    apart = plan_of(
        [rod([layer()], name="a", clamp_start="left"), rod([layer()], name="b", start=(0, 0, 1), clamp_start="right")],
        bodies=walls,
    )
    assert "a – b: held 79" in apart.terms["rod friction"]
    free = plan_of([rod([layer()], name="a"), rod([layer()], name="b", start=(0, 0, 1))])
    assert free.terms["rod barrier"] == free.terms["rod friction"] == "active" and free.contact_pairs == (
        f"a – b{FLAT}",
    )
    off = plan_of([rod([layer()], name="a"), rod([layer()], name="b")], contact={**contact(), "rods": False})
    assert off.terms["rod barrier"] == "skipped: contact.rods is false"
    assert any("rods may pass through each other: a – b" in warning for warning in off.warnings)
    none = plan_of([rod([layer()])], contact=None)
    assert none.terms["rod barrier"] == "skipped: no contact settings" and none.warnings == ()


def test_arms_that_a_hub_holds_side_by_side_do_not_feel_what_joins_them():
    star = rod([layer()], length=0.03, stations=16, name="arm", clamp_start="hub", pattern={"count": 12})
    simulator = Simulator(load_scene(scene([star], bodies=[fixed("hub")], contact=contact())))
    assert simulator.plan.contact_pairs == (f"arm – its copies{FLAT}",)
    simulator.run(0.01)
    assert np.abs(simulator.contact_forces).max() == 0.0


def test_a_rod_that_bends_to_just_over_its_thickness_does_not_feel_itself():
    apart = 1e-3 + D_HAT  # of curves that begin to touch
    path = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.55 * apart, "angle": "190 deg"}
    hairpin = rod([layer()], stations=46) | {"path": path}
    simulator = Simulator(load_scene(scene([hairpin], contact={**contact(), "rods": True})))
    assert simulator.plan.contact_pairs  # it may meet itself elsewhere
    simulator.run(1e-3)
    assert simulator.energy()["rod barrier"] == 0.0
    assert np.abs(simulator.contact_forces).max() == 0.0


def hugging(coefficient):
    """A leaf between two arms of a free body that curl up onto it: nodes that the body holds touch it."""
    active = layer("active", eigenstrain={"stimulus": "heat", "gain": 0.06})
    arms = [
        rod([layer("passive"), active], length=0.04, stations=19, start=(0, 0, z), name=name, clamp_start="hub")
        for name, z in (("under", -2e-3), ("over", 2e-3))
    ]
    arms[0]["normal"] = [0, 0, -1]
    leaf = rod([layer(thickness=0.2e-3)], length=0.03, stations=14, start=(-2e-3, 0, 0), name="leaf")
    motion = {"type": "free", "mass": 1e-3, "inertia": [2e-8] * 3}
    return scene(
        [*arms, leaf],
        bodies=[{"name": "hub", "position": [0, 0, 0], "motion": motion}],
        stimuli={"heat": {"schedule": {"type": "ramp", "start": 0, "end": 0.05, "from": 0, "to": 1}}},
        contact={**contact(coefficient=coefficient), "rods": True},
        damping={"mass": 20.0},
    )


@pytest.mark.parametrize(("gap", "told"), [(0.0, "touches"), (-1e-4, "0.1 mm inside")])
def test_rods_that_start_in_touch_or_in_each_other_are_refused_with_both_names(gap, told):
    """`clamped` is 0.5 mm thick to either side, so is `loose`."""
    lower = rod([layer(thickness=1e-3)], stations=21, name="clamped", clamp_start="wall", width=4e-3)
    upper = rod([layer(thickness=1e-3)], stations=21, name="loose", start=(0, 0, 1e-3 + gap), width=4e-3)
    laid = scene([lower, upper], bodies=[fixed("wall")], contact=contact(barrier_distance=1e-4))
    with pytest.raises(PenetrationError) as refused:
        Simulator(load_scene(laid))
    assert all(text in str(refused.value) for text in ("clamped", "loose", told, "all gaps must be positive"))
