"""Rods of unlike layers meet with their faces, off the curves that the laminate follows."""

import numpy as np
import pytest
from support.evaluations import GRADIENT_LIMIT, HESSIAN_LIMIT, Problem
from support.sample_scenes import GEL, GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.contact.facet import BORDERS
from bilayer_core.contact.rod_bound import FAR
from bilayer_core.contact.step_bound import KEPT_FRACTION
from bilayer_core.testing.gaps import GapCheck

MATERIALS = {"gel": GEL, "paper": {**GEL, "youngs_modulus": 2e9}}


def unlike(names=("gel", "paper")):
    return [layer(name, material=name) for name in names]


def pressed(hub, dimension):
    """A rod that a body holds over two others that lie across each other's meshes; all have unlike layers."""
    top = rod(unlike(), length=0.02, stations=7, start=(0, 0, 0.5e-3), name="top", clamp_start="hub")
    middle = rod(unlike(("paper", "gel")), length=0.02, stations=8, start=(-0.004, 0, -2.4e-3), name="middle")
    low = rod([layer()], length=0.015, stations=5, start=(0, 0, -4.8e-3), name="low", clamp_start="hub")
    low["layers"][0]["thickness"] = 2e-3
    if dimension == 3:
        middle["path"]["start"][1] = 1e-4
    motion = {"type": "prescribed"} if hub == "prescribed" else {"type": "free", "mass": 1e-3, "inertia": [2e-8] * 3}
    bodies = [{"name": "hub", "position": [0, 0, 0], "motion": motion}]
    law = {**contact(coefficient=0.4, speed_threshold=10.0), "rods": True}
    return scene([top, middle, low], bodies=bodies, contact=law, materials=MATERIALS)


@pytest.mark.parametrize("hub", ["prescribed", "free"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_derivatives_of_contact_of_unlike_layers_are_those_of_steps(dimension, hub):
    content = pressed(hub, dimension)
    problem = Problem(
        content, np.random.default_rng(2), "laminate", dimension, h=1e-5, noise=3e-5, origin_noise=1e-6, turns=2e-3
    )
    evaluator, free, scale = problem.evaluator, problem.free, problem.scale
    assert np.abs(problem.model.rails.arm[:, 0]).max() > 0.4e-3
    terms = evaluator.evaluate(problem.at, second=True)
    assert all(terms[term] > 0.0 for term in ("rod barrier", "rod friction"))
    contacts = evaluator.problem.rod_contact.contacts
    assert contacts.count[0] > 20
    for force in ("rod barrier", "rod friction"):
        evaluator.evaluate(problem.at, (force,))
        gradient = problem.gradient()[free]
        errors = [np.abs(problem.differences(h, (force,))[0] - gradient).max() for h in (3e-9, 1e-8, 3e-8)]
        assert min(errors) < 10 * GRADIENT_LIMIT * np.abs(gradient).max()
    evaluator.evaluate(problem.at, second=True)
    assert evaluator.factorise(problem.at) == (0.0, 0)
    loads, rng = [], np.random.default_rng(5)
    for _ in range(3):
        load = np.zeros(len(scale))
        load[free] = rng.standard_normal(len(free)) / scale[free]
        full = problem.basis @ load
        parts = evaluator.newton_step(full[: problem.size], full[problem.size :].reshape(-1, 6))
        loads.append((load * scale, problem.basis.T @ np.concatenate([p.ravel() for p in parts]) / scale))
    errors = []
    for h in (3e-9, 1e-8, 3e-8):
        by_gradient = problem.differences(h)[1]
        by_gradient = 0.5 * (by_gradient + by_gradient.T)  # frames are transported: see `check`
        errors.append(max(np.abs(by_gradient @ step[free] + load[free]).max() for load, step in loads))
    assert min(errors) < HESSIAN_LIMIT * max(np.abs(load).max() for load, _ in loads)


def loose(seed, noise=5e-5):
    """The same rods in space, held by nothing."""
    content = pressed("prescribed", 3)
    for each in content["rods"]:
        each.pop("clamp_start", None)
    del content["bodies"]
    return Problem(content, np.random.default_rng(seed), "laminate", h=1e-5, noise=noise, origin_noise=1e-6, turns=0.05)


def test_contact_of_unlike_layers_exerts_no_net_force_and_no_moment():
    problem = loose(3)
    evaluator, layout, rods = problem.evaluator, problem.model.layout, problem.model.rods
    evaluator.start_stage(problem.at)  # friction is frozen there
    for force in ("rod barrier", "rod friction"):
        assert evaluator.evaluate(problem.at, (force,))[force] > 0.0
        gradient = evaluator.sums.gradient
        of_nodes = gradient[layout.node[:, None] + np.arange(3)]
        scale = np.abs(of_nodes).sum()
        assert np.abs(of_nodes.sum(axis=0)).max() < 1e-13 * scale
        moment = np.cross(problem.at.position, of_nodes).sum(axis=0)
        moment += gradient[layout.edge] @ problem.at.tangent[: rods.edge_count]
        assert np.abs(moment).max() < 1e-13 * scale * 0.02


def borders(problem, at):
    """Middles between the faces of the rods at their left and right borders, two arrays of shape (n_node, 3)."""
    edges, strands = problem.model.surfaces.node_edges, problem.model.strands
    offset, thickness, width = (
        np.concatenate([getattr(s, name) for s in strands]) for name in ("offset", "thickness", "width")
    )
    middle = at.position + offset[:, None] * at.director1[edges].mean(axis=1)
    aside = 0.5 * (width - thickness)[:, None] * at.director2[edges].mean(axis=1)
    return middle - aside, middle + aside


def between(a, b, fraction):
    return a + fraction[..., None] * (b - a)


def fraction_on(a, b, p):
    along = b - a
    return np.clip(((p - a) * along).sum(axis=-1) / (along * along).sum(axis=-1), 0.0, 1.0)


def gaps(problem, at, reach=np.inf):
    """Of all points of each rod from all facets of the others, or from their borders if points see these alone [m].

    A gap beyond `reach`, one number or one of each pair, is not less than what stands for it: that from a ball around
    the facet.
    """
    search, (left, right) = problem.model.rod_search, borders(problem, at)
    j = problem.model.rods.edge_node
    i, s, v = j[search.point_edge], search.point_fraction, search.point_across
    points = between(between(left[i], left[i + 1], s), between(right[i], right[i + 1], s), v)
    point, edge = np.nonzero(search.edge_rod[search.point_edge][:, None] != search.edge_rod)
    radii = search.edge_radius[search.point_edge][point] + search.edge_radius[edge]
    corners = np.stack([left[j], left[j + 1], right[j], right[j + 1]])
    middle = corners.mean(axis=0)
    ball = np.linalg.norm(corners - middle, axis=2).max(axis=0)
    gap = np.linalg.norm(points[point] - middle[edge], axis=1) - ball[edge] - radii
    near = np.flatnonzero(gap < reach)
    points, (first, last, other_first, other_last) = points[point[near]], corners[:, edge[near]]
    v = np.full(len(near), 0.5)
    for _ in range(60):
        t, last_v = fraction_on(between(first, other_first, v), between(last, other_last, v), points), v
        v = fraction_on(between(first, last, t), between(other_first, other_last, t), points)
        if np.allclose(v, last_v, rtol=0.0, atol=1e-14):
            break
    place = between(between(first, last, t), between(other_first, other_last, t), v)
    distance = np.linalg.norm(points - place, axis=1)
    beside = [
        np.linalg.norm(points - between(a, b, fraction_on(a, b, points)), axis=1)
        for a, b in ((first, last), (other_first, other_last))
    ]
    distance = np.where(search.point_sees[point[near]] == BORDERS, np.minimum(*beside), distance)
    gap[near] = distance - radii[near]
    return gap


@pytest.mark.parametrize("size", [3e-5, 3e-4, 3e-3])
def test_a_step_that_moves_and_turns_rods_keeps_a_part_of_every_gap_up_to_its_bound(size):
    problem, rng, cut = loose(4, noise=2e-5), np.random.default_rng(6), 0
    d_hat = problem.model.scene.contact.barrier_distance
    problem.evaluator.evaluate(problem.at, second=True)
    before = gaps(problem, problem.at)
    assert before.min() == pytest.approx(problem.evaluator.gap, rel=1e-9) and before.min() < d_hat
    kept = KEPT_FRACTION * (1.0 - 1e-9) * np.minimum(before, FAR * d_hat)
    for _ in range(20):
        smooth = np.repeat(rng.standard_normal((3, 3)), [7, 8, 5], axis=0)
        step = 0.1 * rng.standard_normal(len(problem.scale))
        layout = problem.model.layout
        step[layout.node[:, None] + np.arange(3)] += smooth
        step[layout.edge] = rng.standard_normal(len(layout.edge))
        parts = problem.split(size * step)
        try:
            fraction = problem.evaluator.bound(problem.at, *parts).fraction
        except LookupError:  # a longer list of near pairs, for which there is capacity now
            problem.evaluator.evaluate(problem.at, second=True)
            fraction = problem.evaluator.bound(problem.at, *parts).fraction
        assert 0.0 < fraction <= 1.0
        cut += fraction < 1.0
        for part in np.linspace(0.0, fraction, 10)[1:]:
            problem.move(problem.at, part * size * step, problem.trial)
            assert np.all(gaps(problem, problem.trial, kept) >= kept)
    assert cut > 3 or size < 1e-4


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_strips_of_unlike_layers_rest_on_each_other_with_their_faces(model):
    thickness, d_hat, strips = 2e-3, 2e-4, []
    for name, start in (("low", 0.0), ("high", thickness + 1.5 * d_hat)):
        strips.append(rod(unlike(), length=0.03, stations=16, start=(0, 0, start), name=name))
    strips[0] |= {"clamp_start": "wall", "clamp_end": "wall"}
    content = scene(
        strips,
        bodies=[fixed()],
        contact={"barrier_distance": d_hat, "stiffness": 1e7, "rods": True},
        materials=MATERIALS,
        gravity=[0, 0, -9.81],
        damping={"mass": 50.0},
        solver={"model": model, "dimension": 2, "integrator": "sdirk2", "dt": 1e-3},
    )
    simulator = Simulator(load_scene(content))
    simulator.run(0.3)
    judge = GapCheck(simulator.model)
    assert judge.smallest(judge.moment(simulator.frame())) == pytest.approx(d_hat, rel=0.02)


@pytest.mark.parametrize("stations", [(9, 9), (21, 34)])
def test_ribbons_press_with_a_part_of_the_stiffness_where_a_border_alone_touches(stations):
    width, thickness, gap, d_hat = 0.01, 2e-3, 0.6e-4, 2e-4
    over = {"face on face": (0, 0, thickness + gap), "border on border": (0, width + gap, 0)}
    over["border on face"] = (0, 0.2 * width, 0.5 * (width + thickness) + gap)
    pressed = {}
    for place, start in over.items():
        low, high = (rod([layer(thickness=thickness)], stations=n) for n in stations)
        high["path"]["start"] = list(start)
        high["normal"] = [0, 1, 0] if place == "border on face" else [0, 0, 1]
        content = scene([low | {"name": "low"}, high | {"name": "high"}], contact={**contact(d_hat), "rods": True})
        problem = Problem(content, np.random.default_rng(0), "laminate", noise=0.0, origin_noise=0.0, turns=0.0)
        problem.evaluator.evaluate(problem.start, ("rod barrier",))
        of_nodes = problem.evaluator.sums.gradient[problem.model.layout.node[:, None] + np.arange(3)]
        pressed[place] = -of_nodes[stations[0] :].sum(axis=0) / 0.1
    s = gap - d_hat
    whole = 1e7 * (2.0 * s * np.log(gap / d_hat) + s * s / gap)
    assert pressed["face on face"] == pytest.approx([0.0, 0.0, whole], rel=1e-9, abs=1e-6 * whole)
    assert pressed["border on border"] == pytest.approx([0.0, 0.25 * whole, 0.0], rel=1e-9, abs=1e-6 * whole)
    assert pressed["border on face"] == pytest.approx([0.0, 0.0, 0.125 * whole], rel=0.01, abs=1e-6 * whole)


def test_ribbons_pushed_against_each_other_on_the_ground_stop_edge_to_edge():
    width, thickness, d_hat, strips = 0.01, 2e-3, 2e-4, []
    for name, start in (("held", 0.0), ("pushed", width + 3.0 * d_hat)):
        path = (0, start, 0.5 * thickness + 0.9 * d_hat)
        strips.append(rod([layer(thickness=thickness)], length=0.02, stations=5, start=path, name=name, width=width))
    strips[0] |= {"clamp_start": "wall"}
    content = scene(
        strips,
        bodies=[fixed()],
        obstacles=[GROUND],
        contact={"barrier_distance": d_hat, "stiffness": 1e7},
        gravity=[0, -1, -9.81],
        damping={"mass": 50.0},
        solver={"model": "laminate", "integrator": "sdirk2", "dt": 2e-3},
    )
    simulator = Simulator(load_scene(content))
    simulator.run(0.5)
    apart = simulator.positions[5:10, 1] - simulator.positions[:5, 1]
    assert apart == pytest.approx(np.full(5, width + d_hat), abs=0.03 * d_hat)
    assert np.abs(simulator.frame().directors[:, 2] - 1.0).max() < 1e-4
