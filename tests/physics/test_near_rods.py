"""Which parts of rods come near each other, and how far a step may go until they meet."""

import numpy as np
import pytest
from support.meeting_rods import CASES, D_HAT, Rods, folded_rod, model_of
from support.sample_scenes import layer, rod

from bilayer_core.contact.rod_bound import FAR
from bilayer_core.contact.step_bound import KEPT_FRACTION
from bilayer_core.model.rod_surfaces import NearPairs


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
        surfaces = model.rod_search
        pairs = NearPairs(surfaces)
        pairs.find(model.start_position, D_HAT, D_HAT)
        counts.append(pairs.count)
        if stations > 201:
            continue
        position = model.start_position + 2e-4 * np.sin(np.arange(3 * model.node_count)).reshape(-1, 3)
        pairs.find(position, D_HAT, D_HAT)
        first = model.rods.edge_node[surfaces.point_edge]
        s = surfaces.point_fraction[:, None]
        points = (1 - s) * position[first] + s * position[first + 1]
        expected = set()
        for k, j in enumerate(model.rods.edge_node):
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
    surfaces = model.rod_search
    pairs = NearPairs(surfaces, 100)
    s, edge = surfaces.point_fraction[:, None], surfaces.point_edge
    exclusion, radii = surfaces.rod_exclusion[0], surfaces.edge_radius[edge][:, None] + surfaces.edge_radius
    arc = surfaces.point_arc[:, None]
    sees = np.maximum(surfaces.edge_arc[:, 0] - arc, arc - surfaces.edge_arc[:, 1]) >= exclusion
    met = 0
    for _ in range(15):
        base = np.concatenate([winding_path(rng, stations, spacing) + [0, 0, 1e-3 * k] for k in range(layers)])
        tip = base + np.tile(winding_path(rng, stations, spacing) * rng.choice([0.0, 0.1, 1.0]), (layers, 1))
        pairs.find(base, D_HAT, reach, tip)
        point, segment = _listed(pairs)
        found = set(zip(point, segment, strict=True))
        assert np.array_equal(np.lexsort((segment, point)), np.arange(pairs.count))
        for part in np.linspace(0.0, 1.0, 11):
            position = base + part * (tip - base)
            points = (1 - s) * position[model.rods.edge_node[edge]] + s * position[model.rods.edge_node[edge] + 1]
            e = position[model.rods.edge_node + 1] - position[model.rods.edge_node]
            way = points[:, None] - position[model.rods.edge_node]
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
    surfaces, found = model.rod_search, []
    i, s = model.rods.edge_node[surfaces.point_edge], surfaces.point_fraction[:, None]
    points = (1.0 - s) * position[i] + s * position[i + 1]
    for own in (0, 1):
        mine = surfaces.edge_rod[surfaces.point_edge] == own
        other = np.flatnonzero(surfaces.edge_rod != own)
        j = model.rods.edge_node[other]
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
