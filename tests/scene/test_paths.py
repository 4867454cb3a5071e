"""Paths of rods by themselves: their frames, what a csv file holds, and what is refused."""

import math

import numpy as np
import pytest
import yaml
from support.documents import blocks
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.planarity import find_plane
from bilayer_core.model.rod_pairs import rod_pairs
from bilayer_core.scene.loader import parse_scene, scene_text

HELIX = {"shape": "helix", "start": [0.01, 0, 0], "axis": [0, 0, 1], "radius": 0.01, "pitch": 0.02, "angle": "3 turns"}
BEND = [[0, 0, 0], [0.03, 0, 0], [0.06, 0, 0.02], [0.07, 0, 0.05]]
KNOT = [[0, 0, 0], [0.03, 0.01, 0.01], [0.05, 0.04, -0.01], [0.04, 0.06, 0.02], [0.01, 0.05, 0.03]]


def on_path(path, normal=(0, 0, 1), stations=41, thickness=2e-4, **more):
    """A scene of one thin rod on a path."""
    thin = rod([layer(thickness=thickness)], stations=stations, width=1e-3, **more)
    return scene([thin | {"path": path, "normal": list(normal)}], bodies=[fixed()])


def rod_on(*arguments, **more):
    return load_scene(on_path(*arguments, **more)).rods[0]


def through(shape, points, **more):
    return {"shape": shape, "points": np.array(points).tolist(), **more}


PATHS = {
    "arc": (
        {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.02, "angle": 2.0},
        (0, 0, 1),
    ),
    "spiral": (
        {
            "shape": "spiral",
            "start": [0, 0, 0],
            "direction": [1, 0, 0],
            "start_radius": 0.02,
            "end_radius": 0.03,
            "angle": 2.0,
            "toward": "opposite",
        },
        (0, 0, 1),
    ),
    "helix, right": (HELIX, (-1, 0, 0)),
    "helix, left": (HELIX | {"handedness": "left"}, (-1, 0, 0)),
    "helix, axis opposite": (HELIX | {"toward": "opposite"}, (1, 0, 0)),
    "spline": (through("spline", KNOT), (0, 0, 1)),
    "spline with normals": (
        through("spline", KNOT, normals=[[0, 0, 1], [0, 1, 1], [-1, 1, 0], [-1, 0, -1], [0, 0.5, -1]]),
        (-0.16, -0.38, 0.91),
    ),
}


@pytest.mark.parametrize(("path", "normal"), PATHS.values(), ids=PATHS)
def test_frames_of_a_path_are_orthonormal_and_turn_as_its_curvatures_say(path, normal):
    curved = rod_on(path, normal=start_normal(path, normal))
    arc, step = curved.path.length * np.linspace(0.013, 0.987, 40), 1e-5 * curved.path.length
    points, tangents, normals = curved.frames_at(arc)
    across = np.cross(tangents, normals)
    after, before = curved.frames_at(arc + step), curved.frames_at(arc - step)
    rates = [(b - a) / (2.0 * step) for a, b in zip(before, after, strict=True)]
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(40), abs=1e-12)
    assert (tangents * normals).sum(axis=1) == pytest.approx(np.zeros(40), abs=1e-12)
    assert rates[0] == pytest.approx(tangents, abs=1e-7)
    found = [(rates[1] * normals).sum(axis=1), (rates[1] * across).sum(axis=1), (rates[2] * across).sum(axis=1)]
    assert np.array(found).T == pytest.approx(curved.curvatures_at(arc), rel=1e-5, abs=1e-3)


def start_normal(path, normal):
    """The normal that a path with normals asks for, any other as it is."""
    if "normals" not in path:
        return normal
    curved = rod_on({**path, "normals": None}, normal=path["normals"][0])
    return curved.frames_at(np.zeros(1))[2][0]


def test_a_helix_has_its_radius_pitch_hand_and_length():
    for hand, sign in (("right", 1.0), ("left", -1.0)):
        curved = rod_on(HELIX | {"handedness": hand}, normal=(-1, 0, 0))
        points, _, normals = curved.frames_at(np.linspace(0.0, curved.path.length, 601))
        angle = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
        assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx(np.full(601, 0.01))
        assert angle[-1] == pytest.approx(sign * 6.0 * math.pi)
        assert points[:, 2] == pytest.approx(0.02 * sign * angle / (2.0 * math.pi))
        assert normals[:, :2] == pytest.approx(-points[:, :2] / 0.01)
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(curved.path.length, rel=1e-4)


def test_a_spline_meets_its_points_and_their_normals_and_has_even_stations():
    path = PATHS["spline with normals"][0]
    curved = rod_on(path, normal=start_normal(*PATHS["spline with normals"]), stations=401)
    points, tangents, normals = curved.frames_at(curved.path.curve.knots)
    assert points == pytest.approx(np.array(KNOT), abs=1e-12)
    own = np.array(path["normals"], dtype=float)
    own -= (own * tangents).sum(axis=1, keepdims=True) * tangents
    assert normals == pytest.approx(own / np.linalg.norm(own, axis=1, keepdims=True), abs=1e-9)
    spacing = np.linalg.norm(np.diff(curved.frames_at(curved.edge_length * np.arange(401))[0], axis=0), axis=1)
    assert np.ptp(spacing) < 1e-4 * spacing.mean()


@pytest.mark.parametrize("shape", ["polyline", "spline"])
def test_a_normal_is_carried_along_without_twist(shape):
    curved = rod_on(through(shape, KNOT), normal=(0, 0, 1), stations=9)
    arc = np.linspace(0.0, curved.path.length, 2001)
    _, tangents, normals = curved.frames_at(arc)
    across = np.cross(tangents, normals)
    twist = 0.5 * (np.diff(normals, axis=0) * (across[:-1] + across[1:])).sum(axis=1)
    assert np.abs(twist).max() < 1e-7
    assert not curved.curvatures_at(arc)[:, 2].any()


def test_corners_of_a_polyline_turn_by_their_angles():
    curved = rod_on(through("polyline", [[0, 0, 0], [0.1, 0, 0], [0.1, 0, 0.1], [0.2, 0, 0.1]]), stations=31)
    assert curved.path.turn == pytest.approx(math.pi)
    points, tangents, normals = curved.frames_at(np.array([0.05, 0.1, 0.15, 0.3]))
    assert points == pytest.approx(np.array([[0.05, 0, 0], [0.1, 0, 0], [0.1, 0, 0.05], [0.2, 0, 0.1]]))
    half = math.sqrt(0.5)
    assert tangents == pytest.approx(np.array([[1, 0, 0], [half, 0, half], [0, 0, 1], [1, 0, 0]]), abs=1e-12)
    assert normals == pytest.approx(np.array([[0, 0, 1], [-half, 0, half], [-1, 0, 0], [0, 0, 1]]), abs=1e-12)
    assert curved.curvatures_at(np.array([0.05, 0.1, 0.2])) == pytest.approx(
        np.array([[0, 0, 0], [200, 0, 0], [-200, 0, 0]]), abs=1e-9
    )


def test_points_of_a_csv_file_are_those_in_the_scene(tmp_path):
    normals = [[0, 0, 1]] * 3 + [[-1, 0, 1]]
    lines = ["x,y,z,nx,ny,nz", *(",".join(map(str, (*p, *n))) for p, n in zip(BEND, normals, strict=True))]
    (tmp_path / "bend.csv").write_text("\n".join(lines) + "\n")
    start = start_normal(through("spline", BEND, normals=normals), None)
    content = on_path({"shape": "spline", "file": "bend.csv"}, normal=start.tolist())
    from_file = parse_scene(yaml.safe_dump(content), "scene", directory=tmp_path)
    inline = load_scene(on_path(through("spline", BEND, normals=normals), normal=start.tolist()))
    assert from_file == inline
    assert parse_scene(scene_text(from_file), "scene") == inline


PLANAR = [through("polyline", BEND), through("spline", BEND)]


@pytest.mark.parametrize("path", PLANAR, ids=["polyline", "spline"])
def test_paths_through_points_of_a_plane_stay_in_it(path):
    assert find_plane(load_scene(on_path(path)))[1] == "all stays in the plane y = 0"
    assert find_plane(load_scene(on_path(path, normal=(0, 1, 0))))[0] is None  # bent across its width
    moved = through(path["shape"], np.array(BEND) + [[0, 0, 0], [0, 0, 0], [0, 1e-6, 0], [0, 0, 0]])
    assert find_plane(load_scene(on_path(moved)))[1].startswith("rods.rod leaves")


def test_a_helix_does_not_stay_in_a_plane():
    assert find_plane(load_scene(on_path(HELIX, normal=(-1, 0, 0))))[1].startswith("rods.rod leaves")


def test_a_path_that_turns_by_half_a_turn_may_meet_itself():
    def about_itself(path, **more):
        content = on_path(path, **more) | {"contact": {"barrier_distance": 1e-4, "stiffness": 1e7}}
        return rod_pairs(load_scene(content))[0].geometry

    assert about_itself(HELIX, normal=(-1, 0, 0)) == "can turn by 1029°"
    assert about_itself(through("polyline", BEND)) == "turns by 72° at most, 180° would be needed to meet itself"


def faults_of(path, directory="", **more):
    with pytest.raises(SceneError) as refused:
        parse_scene(yaml.safe_dump(on_path(path, **more)), "scene", directory=directory)
    return str(refused.value).splitlines()


FIGURE_EIGHT = [[0, 0, 0], [0.05, 0, 0.05], [0.1, 0, 0], [0.05, 0, -0.05], [0, 0, 0.0001], [-0.05, 0, 0.05]]


@pytest.mark.parametrize(
    ("path", "more", "fault"),
    [
        (through("polyline", BEND[:1]), {}, 'path.points: found "1 points"; must be at least 2 points for a polyline'),
        (through("spline", BEND[:2]), {}, 'path.points: found "2 points"; must be at least 3 points for a spline'),
        ({"shape": "spline"}, {}, "path.points: found null; must be given, or `file`"),
        (
            through("polyline", [*BEND, BEND[-1]]),
            {},
            "path.points[4]: found [0.07, 0.0, 0.05]; must be another point than the one before it",
        ),
        (
            through("spline", [[0, 0, 0], [0.1, float("nan"), 0], [0.2, 0, 0]]),
            {},
            "path.points[1][1]: found NaN; must be a length [m]",
        ),
        (
            through("spline", BEND, normals=[[0, 0, 1]]),
            {},
            'path.normals: found "1 entries"; must be as many as points, 4',
        ),
        (
            through("polyline", BEND, normals=[[0, 0, 1], [0, 0, 1], [0, 1, 0], [1, 0, 3]]),
            {},
            "path.normals[3]: found [0.316",
        ),
        (
            through("polyline", BEND, normals=[[0, 0, 1]] * 4),
            {"normal": (0, 1, 0)},
            "normal: found [0.0, 1.0, 0.0]; must be the first of `path.normals`, across the path [0, 0, 1], within 1",
        ),
        (
            through("spline", [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]),
            {"normal": (1, 0, 0.1)},
            "must be across the path, is 5.71 deg from its tangent [1, 0, 0]",
        ),
        (
            through("polyline", [[0, 0, 0], [0.1, 0, 0], [0, 0, 1e-5]]),
            {},
            "path.points[1]: found [0.1, 0.0, 0.0]; must not be a corner where the path folds back on itself",
        ),
        (
            through("spline", [[0, 0, 0], [0.02, 0, 0], [0.022, 0, 0.002], [0.02, 0, 0.004], [0, 0, 0.004]]),
            {"thickness": 5e-3},
            'path.points: found "a radius of ',
        ),
        (
            through("polyline", [[0, 0, 0], [0.1, 0, 0], [0.1, 0, 0.1]]),
            {"thickness": 5e-3, "stations": 101},
            'points: found "a radius of 0.001 m"; must be larger: the path has a radius of 0.001 m, 0.1 m along',
        ),
        (
            through("polyline", [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]]),
            {"stations": 1001},
            "must be larger: the path has a radius of 0.0001 m, 0.1 m along it, and its inner border, 0.0005 m from it",
        ),
        (
            through("spline", FIGURE_EIGHT),
            {"normal": (1, 0, -1)},
            'm along it"; must not come nearer to itself than the thickness',
        ),
        (
            through("polyline", FIGURE_EIGHT),
            {"normal": (1, 0, -1)},
            'm along it"; must not come nearer to itself than the thickness',
        ),
        (
            HELIX | {"pitch": 1e-4},
            {"normal": (-1, 0, 0)},
            'm along it"; must not come nearer to itself than the thickness of the rod, 0.0002 m',
        ),
        (
            HELIX | {"pitch": 0},
            {"normal": (-1, 0, 0)},
            "path.pitch: found 0.0; must be above 0 for a full turn or more: it would close on itself",
        ),
        (
            HELIX | {"radius": 1e-4, "pitch": 1e-3},
            {"normal": (-1, 0, 0), "thickness": 1e-2},
            "path.radius: found 0.0001; must be larger: the path has a radius of ",
        ),
        (HELIX, {"normal": (-1, 0, 0.1)}, "must be perpendicular to the axis of the helix, is 5.71 deg off"),
        (
            through("spline", BEND, file="bend.csv"),
            {},
            'path.file: found "bend.csv"; must be left out where `points` are given',
        ),
        ({"shape": "spline", "file": "none.csv"}, {}, 'path.file: found "none.csv"; must be a readable csv file'),
        (
            {"shape": "spline", "file": "two.csv"},
            {},
            'path.file: found "two.csv"; must have a column z; its columns are x, y',
        ),
        (
            {"shape": "spline", "file": "text.csv"},
            {},
            'path.file: found "text.csv"; must have a number in each line of y, line 3 has "one"',
        ),
    ],
)
def test_a_path_that_cannot_be_is_refused(path, more, fault, tmp_path):
    (tmp_path / "two.csv").write_text("x,y\n0,0\n1,1\n")
    (tmp_path / "text.csv").write_text("x,y,z\n0,0,0\n0.1,one,0\n0.2,0,0\n")
    told = faults_of(path, tmp_path, **more)
    assert len(told) == 1
    assert fault in told[0]


def test_helices_and_coils_that_keep_their_distance_are_accepted():
    radius = HELIX["radius"]
    coil, ring = (
        load_scene(on_path(HELIX | more, normal=(-1, 0, 0))).rods[0].path
        for more in ({"pitch": 3e-4, "angle": "20 turns"}, {"pitch": 0, "angle": 6.0})
    )
    assert coil.length == pytest.approx(20.0 * np.hypot(2.0 * np.pi * radius, 3e-4))
    assert ring.length == pytest.approx(6.0 * radius)
    assert load_scene(on_path(through("spline", KNOT))).rods[0].path.turn > np.pi


def test_the_paths_of_the_tutorial_are_accepted(root):
    examples = [yaml.safe_load(block.text) for block in blocks(root / "docs/tutorial.md") if block.info == "yaml"]
    shown = [example for example in examples if "path" in example]
    assert {example["path"]["shape"] for example in shown} == {"helix", "spline", "polyline"}
    for example in shown:
        rod_on(example["path"], normal=example["normal"])
