"""The contact of rods by itself: derivatives, sums of forces, the Newton matrix, the search for pairs."""

from dataclasses import replace

import numpy as np
import pytest
from evaluations import Problem, at_rest
from sample_scenes import contact, layer, rod, scene
from slips import dissipation

from bilayer_core import load_scene
from bilayer_core.contact.rod_bound import FAR
from bilayer_core.contact.step_bound import KEPT_FRACTION
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.build import build_model
from bilayer_core.model.rod_surfaces import NearPairs

D_HAT = 1e-3


def turned(rod_dict, direction, normal=(0, 0, 1)):
    """The rod along another direction."""
    rod_dict["path"]["direction"], rod_dict["normal"] = list(direction), list(normal)
    return rod_dict


def model_of(rods, **more):
    return build_model(load_scene(scene(rods, contact={**contact(coefficient=0.4), "rods": True}, **more)))


def parallel_rods(rng):
    """Two rods side by side on different meshes, the second longer: insides, nodes and ends of segments face points."""
    rods = [rod([layer()], length=0.02, stations=6, name="a"), rod([layer()], length=0.03, stations=14, name="b")]
    model = model_of([rods[0], {**rods[1], "path": {**rods[1]["path"], "start": [-0.004, 0, 5e-3]}}])
    position = model.start_position.copy()
    position[6:, 2] = 1.7e-3
    return model, position + 1e-4 * rng.standard_normal(position.shape)


def crossed_rods(rng):
    """Two rods that cross between their nodes."""
    rods = [rod([layer()], length=0.02, stations=4, name="a"), rod([layer()], length=0.02, stations=4, name="b")]
    rods[1]["path"]["start"] = [0.01, -0.01, 0.01]
    model = model_of([rods[0], turned(rods[1], (0, 1, 0))])
    position = model.start_position.copy()
    position[4:, 2] = 1.6e-3
    return model, position + 1e-4 * rng.standard_normal(position.shape)


def folded_rod(rng):
    """A bilayer folded onto itself, with kinks in the segments: points face corners from inside."""
    stations = 31
    model = model_of([rod([layer("bottom"), layer("top")], length=0.06, stations=stations)])
    radius = 1.4e-3  # of the fold's path
    arc = np.linspace(0.0, 0.06, stations) - 0.03
    angle = np.clip(arc / radius, -0.5 * np.pi, 0.5 * np.pi)
    straight = arc - radius * angle
    x = radius * np.cos(angle) - np.abs(straight)
    z = radius * np.sin(angle) + 2e-4 * np.cos(400.0 * arc)
    position = model.start_position.copy()
    for strand, height in zip(model.strands, (-0.5e-3, 0.5e-3), strict=True):
        own = slice(strand.first_node, strand.first_node + stations)
        position[own] = np.stack([x, np.zeros(stations), z], axis=1)
        position[own] -= height * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    return model, position + 5e-5 * rng.standard_normal(position.shape)


CASES = {"parallel": parallel_rods, "crossed": crossed_rods, "folded": folded_rod}


class Rods:
    """Contact of the rods of a model at positions of their nodes, as steps evaluate it."""

    def __init__(self, model):
        self.evaluator, self.at = at_rest(model, 0.01)
        self.layout = model.layout

    def start(self, position, origin=None):
        """Freeze contacts for friction; nodes come from `origin`."""
        self.at.position[:] = position
        self.evaluator.start_stage(self.at)
        if origin is not None:
            self.evaluator.stage.origin_position[:] = origin

    def evaluate(self, position, force="rod barrier"):
        """Energy and gradient."""
        self.at.position[:] = position
        energy = self.evaluator.forces(self.at, (force,))[force]
        return energy, self.evaluator.sums.node.copy()

    def bound(self, position, node_step):
        """How far a step of nodes may go."""
        self.at.position[:] = position
        step = np.zeros(self.layout.size)
        step[self.layout.node[:, None] + np.arange(3)] = node_step
        self.evaluator.evaluate(self.at, ("rod barrier", "rod friction"))
        return self.evaluator.bound(self.at, step, np.zeros((0, 6)))

    @property
    def contacts(self):
        """Those found last."""
        return self.evaluator.problem.rod_contact.contacts

    @property
    def lagged(self):
        """Those of friction."""
        return self.evaluator.problem.rod_contact.sliding


def dense(contacts, nodes):
    """Second derivatives of all contacts, from what the kernels leave for the matrix."""
    hessian = np.zeros((nodes, 3, nodes, 3))
    for c in range(contacts.count[0]):
        i, j = contacts.node[c]
        places = [i, i + 1, j, j + 1]
        w, m, a = contacts.weight[c], contacts.matrix[c], contacts.foot_gradient[c]
        side = contacts.tangential_stiffness[c] if contacts.inner[c] else 0.0
        for k, row in enumerate(places):
            for n, column in enumerate(places):
                hessian[row, :, column, :] += w[k] * w[n] * m - side * np.outer(a[k], a[n])
    return hessian.reshape(3 * nodes, 3 * nodes)


def differences(function, position, h):
    """Fourth-order central differences of a function of node positions, by each of their components."""
    rows = []
    for index in range(position.size):
        values = []
        for step in (h, -h, 2 * h, -2 * h):
            moved = position.copy()
            moved.ravel()[index] += step
            values.append(function(moved))
        rows.append((8 * (values[0] - values[1]) - (values[2] - values[3])) / (12 * h))
    return np.array(rows)


@pytest.mark.parametrize("term", ["barrier", "friction"])
@pytest.mark.parametrize("case", CASES)
def test_derivatives_of_rod_contact_agree_with_differences(case, term):
    model, position = CASES[case](np.random.default_rng(3))
    rods, force = Rods(model), f"rod {term}"
    rods.start(position, position + 2e-6 * np.random.default_rng(4).standard_normal(position.shape))
    energy, gradient = rods.evaluate(position, force)
    found = rods.contacts if term == "barrier" else rods.lagged
    hessian = dense(found, model.node_count)
    assert energy > 0.0 and found.count[0] >= 4
    if term == "barrier":
        multiplicity, inner = found.multiplicity[: found.count[0]], found.inner[: found.count[0]]
        assert inner.any()
        assert case != "folded" or multiplicity.min() < 0  # a corner seen from inside
        assert case != "parallel" or not inner.all()
    errors = []
    for h in (1e-9, 3e-9, 1e-8, 3e-8):
        by_energy = differences(lambda at: rods.evaluate(at, force)[0], position, h)
        by_gradient = differences(lambda at: rods.evaluate(at, force)[1].ravel(), position, h)
        errors.append(
            (
                np.abs(by_energy - gradient.ravel()).max() / np.abs(gradient).max(),
                np.abs(by_gradient - hessian).max() / np.abs(hessian).max(),
            )
        )
    best = np.min(errors, axis=0)
    assert best[0] < 1e-7 and best[1] < 1e-6


@pytest.mark.parametrize("case", CASES)
def test_friction_between_rods_along_a_step_is_that_of_the_ways_of_contacts(case):
    model, position = CASES[case](np.random.default_rng(3))
    rods, rng = Rods(model), np.random.default_rng(4)
    origin = position + 2e-6 * rng.standard_normal(position.shape)
    step = 1e-5 * rng.standard_normal(position.shape)
    rods.start(position, origin)
    way, threshold = rods.bound(position, step).slip, model.scene.contact.friction.speed_threshold
    assert len(way) >= 4
    for fraction in (0.0, 0.3, 1.0):
        energy, _ = rods.evaluate(position + fraction * step, "rod friction")
        assert energy == pytest.approx(dissipation(way, fraction, threshold), rel=1e-9)


def moved_rigidly(position):
    turn = rotation_matrix(np.array([0.7, -0.4, 1.9]))
    return position @ turn.T + np.array([0.1, -2.0, 0.3])


@pytest.mark.parametrize("case", CASES)
def test_the_barrier_between_rods_feels_no_rigid_motion_and_exerts_no_net_force(case):
    model, position = CASES[case](np.random.default_rng(5))
    rods = Rods(model)
    energy, gradient = rods.evaluate(position)
    assert rods.evaluate(moved_rigidly(position))[0] == pytest.approx(energy, rel=1e-9)
    assert energy > 0.0
    scale = np.abs(gradient).sum()
    center = position.mean(axis=0)
    assert np.abs(gradient.sum(axis=0)).max() < 1e-13 * scale
    assert np.abs(np.cross(position - center, gradient).sum(axis=0)).max() < 1e-13 * scale * np.ptp(position)


def test_friction_between_rods_is_opposite_on_the_two_and_a_part_of_what_presses_them():
    model, position = parallel_rods(np.random.default_rng(5))
    rods = Rods(model)
    rods.start(position, position)
    load = np.linalg.norm(rods.evaluate(position)[1][6:].sum(axis=0))  # with which the barrier presses
    slipped = position.copy()
    slipped[:6, 0] += 1e-4  # far above the threshold in 10 ms
    _, gradient = rods.evaluate(slipped, "rod friction")
    first, second = -gradient[:6].sum(axis=0), -gradient[6:].sum(axis=0)
    assert first == pytest.approx(-second, abs=1e-12 * load)
    assert first[0] == pytest.approx(-0.4 * load, rel=0.05)  # normals lean by the noise of the shape


MESHES = [(3, 3), (11, 12), (21, 38), (81, 55)]


@pytest.mark.parametrize("stations", MESHES)
def test_parallel_ribbons_press_on_each_other_with_the_same_force_on_any_meshes(stations):
    lower, upper = (rod([layer()], stations=n, name=name) for n, name in zip(stations, "ab", strict=True))
    model = model_of([lower, {**upper, "path": {**upper["path"], "start": [0, 0, 1.8e-3]}}])
    _, gradient = Rods(model).evaluate(model.start_position)
    gap = 0.8e-3
    s = gap - D_HAT
    force = 1e7 * (2.0 * s * np.log(gap / D_HAT) + s * s / gap) * 0.1
    assert -gradient[stations[0] :].sum(axis=0) == pytest.approx([0, 0, force], rel=1e-12, abs=1e-9 * force)


def pressed(hub):
    """Two bilayer arms of a hub, bent onto each other, and a third rod across them; held nodes take part in contact."""
    arms = rod(
        [layer("bottom"), layer("top")], length=0.02, stations=7, start=(0, 0, 0.5e-3), name="arm", clamp_start="hub"
    )
    under = {**rod([layer()], length=0.02, stations=8, start=(-0.004, 1e-4, -2.6e-3), name="under")}
    held = {**rod([layer()], length=0.015, stations=5, start=(0, 0, -5.2e-3), name="held"), "clamp_start": "hub"}
    motion = {"type": "prescribed"} if hub == "prescribed" else {"type": "free", "mass": 1e-3, "inertia": [2e-8] * 3}
    bodies = [{"name": "hub", "position": [0, 0, 0], "motion": motion}]
    law = {**contact(coefficient=0.4, speed_threshold=0.1), "rods": True}
    return scene([arms, under, held], bodies=bodies, contact=law)


def without_elasticity(model):
    """Its gradient has symmetric differences only up to the holonomy of frames."""
    stiff = ("axial_stiffness", "joint_stiffness", "pair_stiffness")
    return replace(model, **{name: 0.0 * getattr(model, name) for name in stiff})


def closer(content):
    """The scene with the rod in the middle nearer to the one above it than the barrier distance."""
    content["rods"][1]["path"]["start"][2] += 0.6e-3
    return content


@pytest.mark.parametrize("hub", ["prescribed", "free"])
def test_the_newton_matrix_with_rod_contact_is_the_derivative_of_the_gradient(hub):
    rng = np.random.default_rng(2)
    problem = Problem(
        closer(pressed(hub)), rng, h=1e-5, noise=5e-5, origin_noise=1e-6, turns=0.0, change=without_elasticity
    )
    evaluator, model, size = problem.evaluator, problem.model, problem.size
    scale, held = problem.scale, np.setdiff1d(np.arange(len(problem.scale)), problem.free)

    def gradient(vector):
        problem.value(vector / scale)
        body = evaluator.sums.body.copy()  # in the chart of rotations at the moved place; wanted is that at `at`
        body[:, 3:] -= 0.5 * np.cross(vector[size:].reshape(-1, 6)[:, 3:], body[:, 3:])
        return np.concatenate([evaluator.sums.gradient, body.ravel()])

    terms = evaluator.evaluate(problem.at, second=True)
    assert evaluator.factorise(problem.at) == (0.0, 0)
    assert terms["rod barrier"] > 0.0 and terms["rod friction"] > 0.0
    contacts = evaluator.problem.rod_contact.contacts
    touching = contacts.node[: contacts.count[0]]
    assert np.isin(touching, model.attached_node).any()
    loads = []
    for _ in range(3):
        load = rng.standard_normal(len(scale)) / scale
        load[held] = 0.0
        step = np.concatenate([p.ravel() for p in evaluator.newton_step(load[:size], load[size:].reshape(-1, 6))])
        step[held] = 0.0
        loads.append((load, step))
    for load, step in loads:
        errors = []
        for h in (1e-8, 3e-8, 1e-7):
            unit = step * h / np.abs(step / scale).max()
            change = (8 * (gradient(unit) - gradient(-unit)) - (gradient(2 * unit) - gradient(-2 * unit))) / 12
            change *= np.abs(step / scale).max() / h
            errors.append(np.abs((change + load) * scale).max() / np.abs(load * scale).max())
        assert min(errors) < 1e-6


def _listed(pairs):
    """Points and segments of near pairs."""
    return pairs.search.point[: pairs.count].tolist(), pairs.search.edge[: pairs.count].tolist()


def test_near_pairs_are_all_that_a_search_of_everything_finds_and_grow_with_the_length():
    counts = []
    for stations in (201, 401, 801):
        length = 2e-3 * (stations - 1)
        rods = [rod([layer()], length=length, stations=stations, name=name) for name in "ab"]
        rods[1]["path"]["start"] = [0.7e-3, 0, 1.8e-3]
        model = model_of(rods)
        surfaces = model.rod_surfaces
        pairs = NearPairs(surfaces, model.edge_node, model.start_position)
        pairs.find(model.start_position, D_HAT, D_HAT)
        counts.append(pairs.count)
        if stations > 201:
            continue
        position = model.start_position + 2e-4 * np.sin(np.arange(3 * model.node_count)).reshape(-1, 3)
        pairs.find(position, D_HAT, D_HAT)
        first = model.edge_node[surfaces.point_edge]
        s = surfaces.point_fraction[:, None]
        points = (1 - s) * position[first] + s * position[first + 1]
        expected = set()
        for k, j in enumerate(model.edge_node):
            e = position[j + 1] - position[j]
            t = np.clip((points - position[j]) @ e / (e @ e), 0.0, 1.0)[:, None]
            distance = np.linalg.norm(points - position[j] - t * e, axis=1)
            other = surfaces.edge_rod[surfaces.point_edge] != surfaces.edge_rod[k]
            expected |= {(int(p), k) for p in np.flatnonzero(other & (distance - 1e-3 < D_HAT))}
        found = list(zip(*_listed(pairs), strict=True))
        assert found == sorted(expected) and len(found) > 1000
    assert counts[2] - counts[1] == 2 * (counts[1] - counts[0])


def winding_path(rng, nodes, spacing):
    """Nodes along a smooth plane curve with random curvature, tighter than that of a rod in use at places."""
    arc = np.linspace(0.0, 1.0, nodes - 1)
    turns = sum(rng.normal(0.0, 2.0) * np.sin(k * np.pi * arc + rng.uniform(0.0, 6.0)) for k in range(1, 6))
    edges = spacing * np.stack([np.cos(turns), np.zeros(nodes - 1), np.sin(turns)], axis=1)
    return np.concatenate([np.zeros((1, 3)), np.cumsum(edges, axis=0)])


@pytest.mark.parametrize("layers", [1, 2])
def test_near_pairs_of_a_rod_that_winds_and_moves_are_all_that_come_near(layers):
    rng = np.random.default_rng(4)
    stations, spacing, reach = 91, 1e-3, 1.9e-3
    parts = [layer(name) for name in ("bottom", "top")[:layers]]
    model = model_of([rod(parts, length=spacing * (stations - 1), stations=stations)])
    surfaces = model.rod_surfaces
    pairs = NearPairs(surfaces, model.edge_node, model.start_position, 100)
    s, edge = surfaces.point_fraction[:, None], surfaces.point_edge
    exclusion, radii = surfaces.rod_exclusion[0], surfaces.edge_radius[edge][:, None] + surfaces.edge_radius
    arc = surfaces.point_arc[:, None]
    sees = np.maximum(surfaces.edge_arc[:, 0] - arc, arc - surfaces.edge_arc[:, 1]) >= exclusion
    met = 0
    for _ in range(40):
        base = np.concatenate([winding_path(rng, stations, spacing) + [0, 0, 1e-3 * k] for k in range(layers)])
        tip = base + np.tile(winding_path(rng, stations, spacing) * rng.choice([0.0, 0.1, 1.0]), (layers, 1))
        pairs.find(base, D_HAT, reach, tip)
        point, segment = _listed(pairs)
        found = set(zip(point, segment, strict=True))
        assert np.array_equal(np.lexsort((segment, point)), np.arange(pairs.count))
        for part in np.linspace(0.0, 1.0, 11):
            position = base + part * (tip - base)
            points = (1 - s) * position[model.edge_node[edge]] + s * position[model.edge_node[edge] + 1]
            e = position[model.edge_node + 1] - position[model.edge_node]
            way = points[:, None] - position[model.edge_node]
            t = np.clip(np.einsum("pkc,kc->pk", way, e) / np.einsum("kc,kc->k", e, e), 0.0, 1.0)
            gap = np.linalg.norm(way - t[:, :, None] * e, axis=2) - radii
            near = {(int(p), int(k)) for p, k in np.argwhere(sees & (gap < reach))}
            assert near <= found
            met += len(near)
            if part == 0.0:
                until = pairs.search.until[: pairs.count]
                np.testing.assert_allclose(until, gap[point, segment] - D_HAT, rtol=0, atol=1e-15)
    assert met > 1000


def gaps_between(model, position):
    """Of all points of the first of two rods from all segments of the second, and the other way round."""
    surfaces, found = model.rod_surfaces, []
    i, s = model.edge_node[surfaces.point_edge], surfaces.point_fraction[:, None]
    points = (1.0 - s) * position[i] + s * position[i + 1]
    for own in (0, 1):
        mine = surfaces.edge_rod[surfaces.point_edge] == own
        other = np.flatnonzero(surfaces.edge_rod != own)
        j = model.edge_node[other]
        along, between = position[j + 1] - position[j], points[mine][:, None] - position[j]
        t = np.clip((between * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
        distance = np.linalg.norm(between - t[..., None] * along, axis=2)
        radii = surfaces.edge_radius[surfaces.point_edge[mine]][:, None] + surfaces.edge_radius[other]
        found.append((distance - radii).ravel())
    return np.concatenate(found)


@pytest.mark.parametrize("case", ["parallel", "crossed"])
def test_a_step_up_to_its_bound_keeps_a_part_of_every_gap_between_rods(case):
    rng = np.random.default_rng(6)
    model, position = CASES[case](rng)
    rods = Rods(model)
    kept = KEPT_FRACTION * np.minimum(gaps_between(model, position), FAR * D_HAT)
    bounded = 0
    for _ in range(40):
        step = 3e-3 * rng.standard_normal(position.shape)
        fraction = rods.bound(position, step).fraction
        bounded += fraction < 1.0
        for part in np.linspace(0.0, fraction, 31):
            assert (gaps_between(model, position + part * step) >= kept - 1e-12).all()
    assert bounded > 10


@pytest.mark.parametrize("size", [1e-5, 1e-4, 1e-3])
def test_contacts_and_the_bound_of_a_step_do_not_depend_on_the_way_that_led_there(size):
    rng = np.random.default_rng(5)
    model, position = folded_rod(rng)
    rods, nodes = Rods(model), position.shape
    made, touching, bounded = 0, 0, 0
    drift = np.zeros(nodes)
    for move in range(200):
        if move % 20 == 0:  # straight on for a while, then elsewhere
            drift = size * rng.standard_normal(nodes)
        step = drift + 0.1 * size * rng.standard_normal(nodes) + np.array([1e-2, 0.0, 0.0])
        fresh, base = Rods(model), rods.evaluator.problem.rod_contact.search.base.copy()
        assert rods.evaluate(position)[0] == fresh.evaluate(position)[0]
        count = fresh.contacts.count[0]
        assert rods.contacts.count[0] == count
        for name in ("point", "node", "weight", "inner", "multiplicity", "gap", "distance", "normal"):
            ours, theirs = getattr(rods.contacts, name), getattr(fresh.contacts, name)
            np.testing.assert_array_equal(ours[:count], theirs[:count])
        fraction = fresh.bound(position, step).fraction
        assert rods.bound(position, step).fraction == fraction
        assert rods.evaluator.gap == fresh.evaluator.gap
        made += not np.array_equal(base, rods.evaluator.problem.rod_contact.search.base)
        touching += count > 0
        bounded += fraction < 1.0
        position = position + 0.8 * fraction * step
        if move % 5 == 4:  # as a line search that returns
            position = position - 0.4 * fraction * step
    assert made < 200 and touching > 20 and (bounded > 5 or size < 1e-4)
