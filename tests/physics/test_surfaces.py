"""Contact points and surfaces: the bound on steps that keeps a part of each gap, and lists of what is near."""

import numpy as np
import pytest
from support.evaluations import at_rest
from support.records_by_hand import record_of
from support.sample_scenes import HALF_SIZES, contact, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.contact.gap import gap_normal
from bilayer_core.contact.step_bound import KEPT_FRACTION, motion_of_points, step_bound
from bilayer_core.forces.surface_pairs import list_surface_pairs
from bilayer_core.jit import piece
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.build_model import build_model
from bilayer_core.model.records.contacts import RodPoints, Surfaces
from bilayer_core.model.records.parts import Bodies, Strands
from bilayer_core.model.records.problem import System
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration
from bilayer_core.model.shape_numbers import NUMBER
from bilayer_core.model.state import initial_state


@piece(float, Surfaces, Configuration, int, int)
def gap_tested(surfaces, at, i, s):
    point = at.contact_point
    return gap_normal(surfaces, at, surfaces.radius[i], s, point[i, 0], point[i, 1], point[i, 2])[0]


@piece(float, Surfaces, Strands, System, Configuration)
def bound_tested(surfaces, strands, system, at):
    return step_bound(surfaces, strands, system, at, np.inf)[0]


@piece(int, Surfaces, Strands, System, Configuration)
def blocking_tested(surfaces, strands, system, at):
    return step_bound(surfaces, strands, system, at, np.inf)[1]


@piece(float, Surfaces, Bodies, Strands, System, Configuration)
def motion_tested(surfaces, bodies, strands, system, at):
    return motion_of_points(surfaces, bodies, strands, system, at)


class Pair:
    """A contact point and a surface in motion over a step, as records for the kernels and as functions of time."""

    def __init__(self, kind, rng, turning):
        rounding = 0.05 if kind == "sphere" else rng.choice([0.0, 0.03])
        self.place, self.turn = rng.uniform(-0.1, 0.1, (1, 3)), rotation_matrix(rng.standard_normal(3))[None]
        self.contact_point = rng.uniform(-0.8, 0.8, (1, 3))
        self.body = np.array([1 if turning else -1])
        one = np.zeros(1, dtype=np.int64)
        self.surfaces = record_of(
            Surfaces,
            kind=np.array([NUMBER[kind]]),
            size=np.array([HALF_SIZES[kind]]),
            rounding=np.array([rounding]),
            radius=np.array([0.01]),
            moved_by=self.body,
            body=one,
            near_contact_point=one,
            near_surface=one,
            near_count=np.ones(1, dtype=np.int64),
            near_node=one,
            near_arm=np.zeros(1, dtype=bool),
            near_radius=np.array([0.01]),
        )
        self.position = np.concatenate(
            [self.place, self.contact_point + rng.uniform(-0.3, 0.3, (1, 3)), np.zeros((1, 3))]
        )
        self.motion = np.zeros((3, 6))
        self.motion[0, :3] = 0.4 * rng.standard_normal(3)
        aim = rng.uniform(0.5, 2.0) * (self.place - self.contact_point)[0]
        self.motion[1, :3] = self.motion[0, :3] + aim + 0.2 * rng.standard_normal(3)
        if turning:
            self.motion[:2, 3:] = rng.choice([0.1, 1.0]) * rng.standard_normal((2, 3))
        self.step = self.motion[1:2, :3].copy()

    def at(self, t):
        """Configuration at a part of the step."""
        turn = (rotation_matrix(t * self.motion[0, 3:]) @ self.turn[0])[None]
        x = self.contact_point + t * self.step
        if self.body[0] == 1:
            arm = rotation_matrix(t * self.motion[1, 3:]) @ (self.contact_point - self.position[1])[0]
            x = (self.position[1] + t * self.motion[1, :3] + arm)[None]
        place = self.place + t * self.motion[0, :3]
        return record_of(
            Configuration, contact_point=x, surface_position=place, surface_rotation=turn, pose_position=self.position
        )

    def gap(self, t):
        return gap_tested(self.surfaces, self.at(t), 0, 0)

    def bound(self):
        system = record_of(System, node_step=self.step, motion=self.motion)
        records = self.surfaces, Strands.absent(), system, self.at(0.0)
        return bound_tested(*records), blocking_tested(*records)


class Border:
    """A contact point at an arm from the middle one of three nodes, of which a body that moves may hold some, and a
    surface at rest.
    """

    def __init__(self, kind, rng, fast, held=(), part=0.0):
        self.position, self.edges = rng.uniform(-0.8, 0.8, 3) + np.zeros((3, 3)), np.array([[0, 0], [0, 1], [1, 1]])
        self.position[[0, 2]] += [[-0.2, 0.0, 0.05], [0.2, 0.02, 0.0]]
        self.tangent = np.diff(self.position, axis=0)
        self.length = np.linalg.norm(self.tangent, axis=1)
        self.tangent /= self.length[:, None]
        m1 = np.cross(self.tangent, rng.standard_normal(3))
        self.m1 = m1 / np.linalg.norm(m1, axis=1, keepdims=True)
        self.arm = rng.uniform(-0.1, 0.1, (1, 2))
        self.place = rng.uniform(-0.1, 0.1, (1, 3))
        aim = self.place - self.position[0 if part == -1.0 else 1]  # from where about the point is
        self.step = rng.uniform(0.5, 2.0) * aim + fast * rng.standard_normal((3, 3))
        self.motion, self.base = np.zeros((2, 6)), np.zeros((2, 3))  # of the body and the world
        self.base[0], self.held = self.position[1] + rng.uniform(-0.2, 0.2, 3), list(held)
        self.motion[0] = [*self.step[1], *(10.0 * fast * rng.standard_normal(3))]
        arms = self.position[self.held] - self.base[0]
        self.step[self.held] = self.motion[0, :3] + np.cross(self.motion[0, 3:], arms)
        self.turn = 10.0 * fast * rng.standard_normal(2)
        self.rotation = rotation_matrix(rng.standard_normal(3))[None]
        self.along = np.array([0.5 * (part - part**2), 0.5 * (part + part**2)])
        self.parts = np.array([0.5 - part, 0.5 + part])
        self.points = RodPoints(
            first=3,
            node=np.array([1]),
            arm=self.arm,
            longest=float(np.linalg.norm(self.arm)) * np.abs(self.parts).sum(),
            node_factor=abs(self.along[0]) + abs(1.0 + self.along[0] - self.along[1]) + abs(self.along[1]),
        )
        one, moved_by = np.zeros(1, dtype=np.int64), np.full(4, -1)
        moved_by[self.held] = 0
        self.surfaces = record_of(
            Surfaces,
            kind=np.array([NUMBER[kind]]),
            size=np.array([HALF_SIZES[kind]]),
            rounding=np.full(1, 0.05 if kind == "sphere" else 0.0),
            radius=np.full(4, 0.01),
            moved_by=moved_by,
            node_free=moved_by[:3] < 0,
            node_edges=self.edges,
            rod_points=self.points,
            body=one + 1,
            near_contact_point=one + 3,
            near_surface=one,
            near_count=one + 1,
            near_node=one + 1,
            near_arm=np.ones(1, dtype=bool),
            near_mix=np.concatenate([self.along, self.parts, self.arm[0]])[None],
            near_radius=np.array([0.01]),
        )
        self.strands = record_of(Strands, edge_node=np.array([0, 1]))
        self.system = record_of(System, node_step=self.step, angle_step=self.turn, motion=self.motion)

    def at(self, t):
        """Configuration at a part of the step: directors are turned with the shortest arc of their edges, then about
        these.
        """
        position, turned = self.position + t * self.step, rotation_matrix(t * self.motion[0, 3:])
        arms = self.position[self.held] - self.base[0]
        position[self.held] = self.base[0] + t * self.motion[0, :3] + arms @ turned.T
        edge = np.diff(position, axis=0)
        length = np.linalg.norm(edge, axis=1)
        tangent, m1 = edge / length[:, None], np.zeros((2, 3))
        for e in range(2):
            axis = np.cross(self.tangent[e], tangent[e])
            sine = np.linalg.norm(axis)
            arc = axis * (np.arctan2(sine, self.tangent[e] @ tangent[e]) / sine if sine else 0.0)
            m1[e] = rotation_matrix(t * self.turn[e] * tangent[e]) @ rotation_matrix(arc) @ self.m1[e]
        m2 = np.cross(tangent, m1)
        point = position[1] + self.along @ edge + self.parts @ (self.arm[0, 0] * m1 + self.arm[0, 1] * m2)
        return record_of(
            Configuration,
            contact_point=np.concatenate([position, point[None]]),
            position=position,
            length=length,
            tangent=tangent,
            director1=m1,
            director2=m2,
            surface_position=self.place,
            surface_rotation=self.rotation,
            pose_position=self.base,
        )

    def gap(self, t):
        return gap_tested(self.surfaces, self.at(t), 3, 0)

    def bound(self):
        records = self.surfaces, self.strands, self.system, self.at(0.0)
        return bound_tested(*records), blocking_tested(*records)

    def largest_motion(self):
        records = self.surfaces, Bodies.absent(), self.strands, self.system, self.at(0.0)
        return motion_tested(*records)


def bound_that_keeps_the_gap(pair, start, samples):
    """The step bound of a pair, along which the gap keeps what it must of its start."""
    alpha, blocking = pair.bound()
    assert (blocking >= 0) == (alpha < 1.0)
    before = np.array([pair.gap(t) for t in np.linspace(0.0, alpha, samples)])
    assert before.min() >= KEPT_FRACTION * start * (1.0 - 1e-9)
    return alpha


@pytest.mark.parametrize("turning", [False, True], ids=["straight", "turning"])
@pytest.mark.parametrize("kind", HALF_SIZES)
def test_step_bound_is_the_first_moment_at_which_a_gap_shrinks_to_the_kept_fraction(kind, turning):
    rng = np.random.default_rng(4)
    limited = 0
    for _ in range(80):
        pair = Pair(kind, rng, turning)
        start = pair.gap(0.0)
        if start <= 0.0:
            continue
        alpha = bound_that_keeps_the_gap(pair, start, 30)
        if alpha < 1.0:
            limited += 1
            assert pair.gap(alpha) == pytest.approx(KEPT_FRACTION * start, abs=1e-5 * start)
    assert limited > 10


HELD = {"free": [], "beside one": [0], "between two": [0, 2], "held": [1]}
FAST = {"slow": 0.01, "fast": 0.1, "turned over": 0.5}
PARTS = {"at a station": 0.0, "between stations": 0.4, "at an end": -1.0}
OF_EACH_TWO = [
    pytest.param(kind, HELD[held], FAST[fast], PARTS[part], id=f"{kind}-{held}-{fast}-{part}")
    for i, kind in enumerate(HALF_SIZES)
    for j, held in enumerate(HELD)
    for fast, part in [(list(FAST)[(i + j) % 3], list(PARTS)[(i + 2 * j) % 3])]
]
"""Any two of them meet."""


@pytest.mark.parametrize(("kind", "held", "fast", "part"), OF_EACH_TWO)
def test_the_step_bound_of_a_point_with_an_arm_keeps_the_kept_fraction_of_its_gap(kind, held, fast, part):
    rng = np.random.default_rng(6)
    limited = sharp = 0
    for _ in range(25):
        pair = Border(kind, rng, fast, held, part)
        start = pair.gap(0.0)
        if start <= 0.0:
            continue
        alpha = bound_that_keeps_the_gap(pair, start, 30)
        limited += alpha < 1.0
        sharp += alpha < 1.0 and pair.gap(alpha) < (KEPT_FRACTION + 1e-5) * start
    assert limited > 5 and (sharp > 0.5 * limited or fast > 0.01)


@pytest.mark.parametrize(("kind", "held", "fast", "part"), OF_EACH_TWO)
def test_no_point_with_an_arm_moves_farther_than_the_motion_that_lists_are_made_for(kind, held, fast, part):
    rng, nearest = np.random.default_rng(7), np.inf
    for _ in range(25):
        pair = Border(kind, rng, fast, held, part)
        motion, start = pair.largest_motion(), pair.at(0.0).contact_point[3]
        for t in np.linspace(0.1, 1.0, 10):
            moved = np.linalg.norm(pair.at(t).contact_point[3] - start)
            assert moved <= t * motion * (1.0 + 1e-12)
            nearest = min(nearest, t * motion / moved)
    assert nearest < 10.0


def test_a_list_of_near_pairs_holds_what_is_near_and_the_nearest():
    rng = np.random.default_rng(5)
    kinds = np.array([NUMBER[kind] for kind in HALF_SIZES])
    size, rounding = np.array(list(HALF_SIZES.values())), np.array([0.0, 0.1, 0.02, 0.0])
    bound = np.array([np.inf, 0.1, 0.5, 0.5])
    turn = np.array([rotation_matrix(rng.standard_normal(3)) for _ in kinds])
    radius, group = np.full(300, 0.01), np.tile([0, 1], 150)
    can_collide = np.array([[True, True], [True, False], [False, True], [True, True]])
    listed = {name: np.zeros(1200, dtype=np.int64) for name in ("near_contact_point", "near_surface", "near_node")}
    listed |= {name: np.zeros(1200) for name in ("near_gap", "near_radius", "near_weight", "near_length")}
    listed |= {"near_arm": np.zeros(1200, dtype=bool), "near_mix": np.zeros((1200, 6)), "sharpest": np.full(4, -1.0)}
    then = {"listed_contact_point": (300, 3), "listed_surface_position": (4, 3), "listed_surface_rotation": (4, 3, 3)}
    for reach, spread in ((0.05, 1.0), (0.01, 5.0)):
        place, contact_point = rng.uniform(-spread, spread, (4, 3)), rng.uniform(-spread, spread, (300, 3))
        at = record_of(Configuration, contact_point=contact_point, surface_position=place, surface_rotation=turn)
        surfaces = record_of(
            Surfaces,
            d_hat=reach,
            kind=kinds,
            size=size,
            rounding=rounding,
            bound=bound,
            radius=radius,
            group=group,
            can_collide=can_collide,
            extent=np.zeros(4),
            weight=np.ones(300),
            margin=np.array([-1.0]),
            near_count=np.zeros(1, dtype=np.int64),
            **listed,
            **{name: np.zeros(shape) for name, shape in then.items()},
        )
        gaps = {
            (s, i): gap_tested(surfaces, at, i, s) for s in range(4) for i in range(300) if can_collide[s, group[i]]
        }
        assert list_surface_pairs(surfaces, at, 0.01) == READY
        count, within = surfaces.near_count[0], reach + max(reach, 0.04)
        pairs = list(
            zip(*(listed[name][:count].tolist() for name in ("near_surface", "near_contact_point")), strict=True)
        )
        assert pairs == sorted(pairs) and set(pairs) <= gaps.keys()
        assert {pair for pair, gap in gaps.items() if gap <= within} <= set(pairs)
        assert min(gaps, key=gaps.get) in pairs
        assert count < len(gaps)
        assert np.array_equal(surfaces.listed_contact_point, contact_point) and np.array_equal(
            surfaces.listed_surface_rotation, turn
        )


@pytest.mark.parametrize(
    ("length", "height", "shift", "turn"),
    [(0.02, -1.8e-3, 0.04, 0.0), (0.3, -4e-3, 0.0, 0.04)],
    ids=["shifted", "turned"],
)
def test_what_a_moving_surface_comes_near_to_is_seen_in_time(length, height, shift, turn):
    plate = {"name": "plate", "position": [0.05, 0, height], "motion": {"type": "prescribed"}}
    plate["surface"] = {"shape": "box", "size": [length, 0.1, 2e-3]}  # touches the strip from 1.5 mm below its curve
    model = build_model(load_scene(scene([rod([layer()])], bodies=[plate], contact=contact())))

    def energy(evaluator, part):
        """Along the strip, or from one of its ends to the other, −1 … 1."""
        state, at = initial_state(model), evaluator.new()
        state.body_position[0, 0] += part * shift
        state.body_rotation[0] = rotation_matrix(np.array([0.0, part * turn, 0.0]))
        evaluator.take_state(state, at)
        return evaluator.forces(at, ("barrier",))["barrier"]

    evaluator, _ = at_rest(model, 0.01)
    parts = np.linspace(-1.0, 1.0, 41)
    found = [energy(evaluator, part) for part in parts]
    assert found == [energy(at_rest(model, 0.01)[0], part) for part in parts]
    assert found[0] > 0.0 and np.isfinite(found).all() and found[-1] > 0.0
