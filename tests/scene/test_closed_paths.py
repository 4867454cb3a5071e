"""Closed paths: curves without ends whose frames close, and what is refused."""

import math

import numpy as np
import pytest
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.errors import SceneError

CIRCLE = {"shape": "arc", "start": [0.03, 0, 0], "direction": [0, 0, 1], "radius": 0.03, "angle": "360 deg"}
INWARD = (-1, 0, 0)
CORNERS = [[0, 0, 0], [0.05, 0, 0], [0.06, 0, 0.04], [0.01, 0, 0.05]]
TURN = 2.0 * math.pi * np.arange(12) / 12
WAVY = np.stack([0.03 * np.cos(TURN), 0.03 * np.sin(TURN), 8e-3 * np.sin(2 * TURN) + 4e-3 * np.cos(3 * TURN)], axis=1)
OVAL = 0.03 * (1.0 + 0.4 * np.cos(2 * TURN))
SADDLE = np.stack([OVAL * np.cos(TURN), OVAL * np.sin(TURN), 0.02 * np.sin(2 * TURN)], axis=1)
EIGHT = [[0, 0, 0], [0.05, 0, 0.05], [0.1, 0, 0], [0.05, 0, -0.05], [0, 0, 0.00005], [-0.05, 0, 0.05]]
TREFOIL = 0.02 * np.stack(
    [np.sin(TURN) + 2 * np.sin(2 * TURN), np.cos(TURN) - 2 * np.cos(2 * TURN), -np.sin(3 * TURN)], axis=1
)


def through(shape, points, **more):
    return {"shape": shape, "points": np.array(points).tolist(), "closed": True, **more}


def on_path(path, normal=(0, 0, 1), stations=81, **more):
    thin = rod([layer(thickness=2e-4)], stations=stations, width=1e-3)
    return scene([thin | {"path": path, "normal": list(normal)} | more], bodies=[fixed()])


def rod_on(*arguments, **more):
    return load_scene(on_path(*arguments, **more)).rods[0]


def faults_of(*arguments, **more):
    with pytest.raises(SceneError) as refused:
        load_scene(on_path(*arguments, **more))
    return str(refused.value).splitlines()


CLOSED = {
    "circle": (CIRCLE | {"closed": True}, INWARD),
    "polygon": (through("polyline", CORNERS), (0, 1, 0)),
    "polygon, bent through its thickness": (through("polyline", CORNERS), (0, 0, 1)),
    "polygon in space": (through("polyline", WAVY), (1, 0, 0)),
    "spline": (through("spline", CORNERS), (0, 0, 1)),
    "spline in space": (through("spline", WAVY), (1, 0, 0)),
    "trefoil": (through("spline", TREFOIL), (0, 0, 1)),
    "spline with normals": (through("spline", WAVY, normals=(WAVY + [0, 0, 0.01]).tolist()), None),
}


@pytest.mark.parametrize(("path", "normal"), CLOSED.values(), ids=CLOSED)
def test_frames_of_a_closed_path_are_those_of_its_start_again_at_its_end(path, normal):
    if normal is None:  # across the path, as the first of `normals` counts
        tangent = rod_on({**path, "normals": None}, normal=path["normals"][0]).frames_at(np.zeros(1))[1][0]
        normal = np.array(path["normals"][0]) - np.dot(path["normals"][0], tangent) * tangent
    closed = rod_on(path, normal=normal)
    near = 1e-7 * closed.path.length
    ends = closed.frames_at(closed.path.length * np.array([0.0, 1.0]))
    before, after = closed.frames_at(np.array([closed.path.length - near])), closed.frames_at(np.array([near]))
    for own, left, right in zip(ends, before, after, strict=True):
        assert own[1] == pytest.approx(own[0], abs=1e-12)
        if path["shape"] != "polyline":
            assert left == pytest.approx(right, abs=1e-4)
    rates = closed.curvatures_at(closed.path.length * np.array([0.0, 1.0]))
    assert rates[1] == pytest.approx(rates[0], rel=1e-9, abs=1e-9)


def test_a_closed_path_may_start_at_any_of_its_points_and_have_the_first_again_at_its_end():
    for shape in ("polyline", "spline"):
        first = rod_on(through(shape, WAVY), normal=(1, 0, 0)).path
        for points in (np.roll(WAVY, 5, axis=0), [*WAVY, WAVY[0]]):
            other = rod_on(through(shape, points), normal=(0.4, 0.3, 1)).path
            assert other.length == pytest.approx(first.length, rel=1e-12)
            assert other.turn == pytest.approx(first.turn, rel=1e-6)
    assert rod_on(through("polyline", CORNERS)).path.turn == pytest.approx(2.0 * math.pi)


def writhe(points):
    """Of a closed polygon: Gauss's double integral, solid angles of pairs of segments (Klenin and Langowski 2000)."""
    count = len(points)
    first, second = np.triu_indices(count, 2)
    apart = second - first < count - 1
    i, j = first[apart], second[apart]
    start, end = points, np.roll(points, -1, axis=0)
    corners = [start[j] - start[i], end[j] - start[i], end[j] - end[i], start[j] - end[i]]
    faces = [np.cross(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    units = [face / np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-300) for face in faces]
    cosines = [(a * b).sum(axis=1) for a, b in zip(units, units[1:] + units[:1], strict=True)]
    side = (np.cross(end[j] - start[j], end[i] - start[i]) * (start[j] - start[i])).sum(axis=1)
    return (np.sign(side) * np.arcsin(np.clip(cosines, -1.0, 1.0)).sum(axis=0)).sum() / (2.0 * math.pi)


def link(path, normal):
    """Twist and writhe of a rod on a path, in turns."""
    closed = rod_on(path, normal=normal)
    arc = closed.path.length * np.arange(400) / 400
    return closed.curvatures_at(arc)[:, 2].mean() * closed.path.length / (2 * math.pi), writhe(closed.frames_at(arc)[0])


@pytest.mark.parametrize("points", [SADDLE, TREFOIL], ids=["saddle", "trefoil"])
def test_twist_and_writhe_of_a_closed_path_add_up_to_a_whole_number(points):
    twist, own = link(through("spline", points), (0, 0, 1))
    assert abs(own) > 0.01
    assert abs(twist) <= 0.5
    assert twist + own == pytest.approx(round(twist + own), abs=2e-3)


@pytest.mark.parametrize("turns", [-1, 0, 1, 2])
def test_normals_that_turn_n_times_add_n_to_twist_and_writhe(turns):
    fine = 2.0 * math.pi * np.arange(24) / 24
    circle = 0.03 * np.stack([np.cos(fine), np.sin(fine), 0.0 * fine], axis=1)
    up, outward = np.tile([0.0, 0.0, 1.0], (24, 1)), circle / 0.03
    angle = turns * fine[:, None]
    normals = np.cos(angle) * outward - np.sin(angle) * up  # t × outward is −up
    twist, own = link(through("spline", circle, normals=normals.tolist()), (1, 0, 0))
    assert own == pytest.approx(0.0, abs=1e-9)
    assert twist == pytest.approx(turns, abs=1e-9)


def moebius(points=12):
    turn = 2.0 * math.pi * np.arange(points) / points
    circle = 0.03 * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    half = 0.5 * turn[:, None]
    return circle, np.cos(half) * circle / 0.03 + np.sin(half) * np.array([0.0, 0.0, 1.0])


def test_half_a_turn_does_not_close():
    circle, normals = moebius()
    path = through("spline", circle, normals=normals.tolist())
    (told,) = faults_of(path, normal=(1, 0, 0))
    assert "path.normals[11]: found [" in told
    assert "must turn by at most 90 deg from the last point back to the first, turns by 165 deg" in told
    assert "whole turns close, half ones (a Moebius band) do not" in told
    again = through("spline", [*circle, circle[0]], normals=[*normals.tolist(), [-1, 0, 0]])
    (told,) = faults_of(again, normal=(1, 0, 0))
    assert "path.normals[12]: found [-1.0, 0.0, 0.0]; must be the first normal, as the point is" in told


@pytest.mark.parametrize(
    ("path", "normal", "fault"),
    [
        (
            CIRCLE | {"closed": True, "angle": "350 deg"},
            INWARD,
            "path.angle: found 6.1086523819801535; must be 360 deg of a closed path: its ends are 0.00523 m apart",
        ),
        (CIRCLE | {"closed": True, "angle": "720 deg"}, INWARD, "must be 360 deg of a closed path"),
        (CIRCLE, INWARD, "must not come nearer to itself than the thickness of the rod, 0.0002 m; a ring without ends"),
        (
            CIRCLE | {"angle": "400 deg"},
            INWARD,
            "must not come nearer to itself than the thickness of the rod, 0.0002 m",
        ),
        (
            {
                "shape": "spiral",
                "start": [0, 0, 0],
                "direction": [1, 0, 0],
                "start_radius": 0.02,
                "end_radius": 0.0215,
                "angle": "10 turns",
            },
            (0, 0, 1),
            "must not come nearer to itself than the thickness of the rod, 0.0002 m",
        ),
        (through("spline", WAVY[:2]), (0, 0, 1), 'path.points: found "2 points"; must be at least 3 points for a clos'),
        (
            through("polyline", [*CORNERS[:2], CORNERS[0]]),
            (0, 0, 1),
            'path.points: found "2 points"; must be at least 3 points for a closed polyline',
        ),
        (
            through("spline", [*CORNERS, [1e-4, 0, 0]]),
            (0, 0, 1),
            "path.points[4]: found [0.0001, 0.0, 0.0]; must be the first point or well apart from it: the path does "
            "not close by 0.0001 m",
        ),
        (
            through("polyline", [[0, 0, 0], [0.05, 0, 0], [0, 0, 0.006]]),
            (0, 1, 0),
            "path.points[1]: found [0.05, 0.0, 0.0]; must not be a corner where the path folds back on itself",
        ),
        (
            through("spline", EIGHT),
            (1, 0, -1),
            'm along it"; must not come nearer to itself than the thickness',
        ),
        (
            {"shape": "polyline", "points": [*CORNERS, [0, 0, 1e-5]]},
            (0, 0, 1),
            "must not come nearer to itself than the thickness of the rod, 0.0002 m; a ring without ends is",
        ),
        (
            {"shape": "straight", "start": [0, 0, 0], "direction": [1, 0, 0], "length": 1, "closed": True},
            (0, 0, 1),
            "path.closed: unknown key",
        ),
    ],
)
def test_a_path_that_does_not_close_or_crosses_itself_is_refused(path, normal, fault):
    told = faults_of(path, normal=normal)
    assert len(told) == 1
    assert fault in told[0]


@pytest.mark.parametrize(
    ("more", "fault"),
    [
        ({"clamp_start": "wall"}, 'clamp_start: found "wall"; must be left out: a closed path has no ends to hold'),
        ({"clamp_end": "wall"}, 'clamp_end: found "wall"; must be left out: a closed path has no ends to hold'),
        ({"stations": 4}, "stations: found 4; must be at least 5 on a closed path"),
        (
            {"width": {"at": [0, 0.1], "value": [1e-3, 2e-3]}},
            'width: found "a profile"; must be the same where a closed path starts and ends, is 0.001 and 0.002 there',
        ),
        (
            {"layers": [layer("low", thickness=2e-4), layer("high", thickness=2e-4, interval=[0, 0.1])]},
            "layers.high.interval: found [0.0, 0.1]; must begin an edge, 0.00235619 m, or more after the start of a",
        ),
        (
            {"pattern": {"count": 2, "clamp_end": ["wall", "wall"]}},
            'pattern.clamp_end: found ["wall", "wall"]; must be left out: a closed path has no ends to hold',
        ),
    ],
)
def test_a_closed_rod_has_nothing_that_needs_ends(more, fault):
    assert any(fault in told for told in faults_of(CIRCLE | {"closed": True}, normal=INWARD, **more))


def test_spirals_and_circles_that_keep_their_distance_are_accepted():
    spiral = {"shape": "spiral", "start": [0, 0, 0], "direction": [1, 0, 0], "start_radius": 0.02, "end_radius": 0.03}
    assert rod_on(spiral | {"angle": "10 turns"}).path.turn > 60.0
    assert rod_on(CIRCLE | {"angle": "359 deg"}, normal=INWARD).path.turn < 2.0 * math.pi
    assert rod_on(CIRCLE | {"closed": True}, normal=INWARD).closed
