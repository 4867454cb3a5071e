"""Round rods, hollow or not: where they rest, what they weigh, how they are drawn, and what is refused."""

import json
import math

import numpy as np
import pytest
from support.sample_scenes import GEL, GROUND, contact, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.log.messages.description_text import from_text, to_text
from bilayer_core.scene.loader import load_content, scene_content
from bilayer_core.view import geometry

RADIUS, HOLE, LENGTH = 2e-3, 1e-3, 0.05
ROUND = {"radius": RADIUS, "layers": [{"name": "wall", "material": "gel"}]}


def round_rod(**more):
    """A round rod along x."""
    made = rod([layer()], length=LENGTH, stations=11) | ROUND | more
    return {key: value for key, value in made.items() if key != "width"}


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_mass_of_a_tube_with_a_tapered_hole_is_that_of_its_wall(model):
    hole = {"at": [0.0, LENGTH], "value": [0.0, HOLE]}
    simulator = Simulator(load_scene(scene([round_rod(inner_radius=hole)])), model=model)
    volume = math.pi * (RADIUS**2 - HOLE**2 / 3.0) * LENGTH
    assert simulator.model.rods.node_mass.sum() == pytest.approx(GEL["density"] * volume, rel=2e-3)


@pytest.mark.parametrize("roll", [0.0, 0.3, 0.9, math.pi / 2])
def test_a_round_rod_rests_at_its_radius_whatever_its_roll(roll):
    lying = round_rod(normal=[0, math.sin(roll), math.cos(roll)])
    lying["path"] = lying["path"] | {"start": [0, 0, RADIUS + 9e-5]}
    content = scene([lying], gravity=[0, 0, -9.81], obstacles=[GROUND], contact=contact(barrier_distance=1e-4))
    simulator = Simulator(load_scene(content | {"solver": {}}))
    simulator.solve_static()
    gap = simulator.positions[1:-1, 2] - RADIUS
    excess, limit = gap - 1e-4, 1e-4
    carried = content["contact"]["stiffness"] * -(2.0 * excess * np.log(gap / limit) + excess**2 / gap)
    weight = GEL["density"] * math.pi * RADIUS**2 * 9.81
    assert -carried == pytest.approx(np.full(9, weight), rel=1e-3)
    assert np.ptp(gap) < 1e-9


def test_what_is_written_of_a_round_rod_is_read_again():
    config = load_scene(scene([round_rod(inner_radius=HOLE)]))
    again = load_scene(json.loads(json.dumps(scene_content(config))))
    assert again == config and again.rods[0].width == 2.0 * RADIUS
    thicker = load_content(scene_content(config), {"rods.rod.radius": "3 mm"})
    assert thicker.rods[0].layers[0].thickness == 6e-3


def test_a_round_rod_is_drawn_as_an_octagon_by_those_who_read_its_log():
    description = Simulator(load_scene(scene([round_rod(), rod([layer()], name="flat")]))).description
    read = from_text(to_text(description), description.scene_text)
    wire, flat = read.strands
    assert wire.round and not flat.round
    frames = np.tile([0.0, 0.0, 0.0, 1.0], (1, 11, 1))
    corners = geometry.ribbon_vertices(wire, np.zeros((1, 11, 3)), frames)
    assert np.linalg.norm(corners, axis=-1) == pytest.approx(np.full((1, 11, geometry.CORNERS), RADIUS), rel=1e-6)
    normals = geometry.ribbon_normals(wire, frames)
    assert normals == pytest.approx(corners / RADIUS, abs=1e-5)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"radius": None}, "rods.rod.width"),
        ({"inner_radius": RADIUS}, "rods.rod.inner_radius: found 0.002; must be below `radius`"),
        ({"width": 1e-3}, "rods.rod.width: found 0.001; must be left out"),
        ({"layers": [layer("a"), layer("b")]}, "rods.rod.radius"),
        ({"layers": [{"name": "a", "material": "gel", "thickness": 1e-3}]}, "rods.rod.layers.a.thickness"),
        ({"radius": {"at": [0.0, 1.0], "value": [1e-3, 2e-3]}}, "rods.rod.radius.at[1]"),
        ({"radius": -1.0}, "rods.rod.radius"),
    ],
)
def test_sections_that_cannot_be_are_refused_with_the_key(change, key):
    made = round_rod()
    made.update(change)
    with pytest.raises(SceneError, match=key.replace("[", r"\[").replace("]", r"\]")):
        load_scene(scene([made]))
