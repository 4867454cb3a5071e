"""The judge's least gap of a ribbon to a surface is that of a dense search, wherever the surface is."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from bilayer_core.testing.rectangles import Rectangles, apart
from bilayer_core.testing.ribbons import FINE, Sheet
from bilayer_core.testing.surfaces import SceneSurface

UNIT, STRETCHES, LENGTH = 2e-4, 8, 0.06
NONE = np.empty(0)


def ribbon(random):
    """A ribbon of 19 mm that winds and twists."""
    t, (phase, twist) = np.linspace(0.0, 1.0, STRETCHES + 1), random.uniform(0.0, 2.0, 2)
    middle = np.stack([LENGTH * t, 0.01 * np.sin(6.0 * t + phase), 0.01 * np.cos(5.0 * t)], axis=1)
    half = 9e-3 * np.stack([0.0 * t, np.cos(twist * t), np.sin(twist * t)], axis=1)
    sections = np.stack([middle, half])
    third = np.gradient(sections, axis=1) / 3.0
    begin, end = sections[:, :-1], sections[:, 1:]
    return Sheet(
        np.stack([begin, begin + third[:, :-1], end - third[:, 1:], end], axis=2), np.full((STRETCHES, 2), 5e-4)
    )


def size_of(kind, random):
    if kind == "sphere":
        return np.full(3, random.uniform(5e-4, 0.02))
    size = random.uniform(1e-3, 1e-2, 3)
    return size if kind == "box" else size[[0, 0, 2]]


@pytest.mark.parametrize("kind", ["sphere", "box", "cylinder"])
@pytest.mark.parametrize("seed", range(8))
def test_the_least_gap_is_that_of_a_dense_search(kind, seed):
    random = np.random.default_rng(seed)
    sheet, half = ribbon(random), size_of(kind, random)
    rounding = half[0] if kind == "sphere" else 0.3 * half.min() * (seed % 2)
    surface = SceneSurface(kind, 0, kind, half, rounding, NONE, NONE)
    place = random.uniform([0.0, -0.02, -0.02], [LENGTH, 0.02, 0.03]), Rotation.random(random_state=seed).as_matrix()
    grid = np.meshgrid(np.arange(STRETCHES), np.linspace(0.0, 1.0, 61), np.linspace(-1.0, 1.0, 121), indexing="ij")
    x, radius = sheet.at(*(of.ravel() for of in grid))
    dense = (surface.distance((x - place[0]) @ place[1]) - radius).min()
    found = sheet.least_gap(np.arange(STRETCHES), surface, place, UNIT, np.inf)
    if dense < -UNIT:  # how deep it is, is not looked for
        assert dense - LENGTH / STRETCHES / 50 < found < -UNIT
    else:
        assert dense - LENGTH / STRETCHES / 50 < found < dense + FINE * UNIT


def test_the_distance_of_rectangles_is_that_of_least_squares():
    random = np.random.default_rng(1)

    def rectangles():
        sides = np.stack([Rotation.random(random_state=random).as_matrix()[:2] for _ in range(60)])
        return Rectangles(random.normal(size=(60, 3)), sides * random.uniform(0.0, 1.5, (60, 2, 1)))

    one, other = rectangles(), rectangles()
    expected = []
    for a, b in zip(zip(one.middle, one.half, strict=True), zip(other.middle, other.half, strict=True), strict=True):
        way, away = np.concatenate([a[1], -b[1]]).T, b[0] - a[0]
        expected.append(np.linalg.norm(way @ lsq_linear(way, away, (-1.0, 1.0), tol=1e-14).x - away))
    found = apart(one, other)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert 0 < (found == 0.0).sum() < 60
    enough = apart(one, other, 0.5)
    assert np.all((enough == found) | (enough >= 0.5)) and np.all(enough <= found + 1e-12)
    assert (enough < found).any()
