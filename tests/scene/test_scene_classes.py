"""Scenes that programs make of classes."""

import copy
import pickle
import subprocess
import sys
from inspect import signature

import numpy as np
import pytest
from support.sample_scenes import everything

import bilayer_core
from bilayer_core import (
    Body,
    Eigenstrain,
    Hold,
    Layer,
    Light,
    Material,
    Prescribed,
    Rod,
    Scene,
    Simulator,
    Stimulus,
    StraightPath,
    load_scene,
)
from bilayer_core.errors import SceneError
from bilayer_core.scene import scene_classes
from bilayer_core.scene.loader import scene_content, scene_text
from bilayer_core.scene.part import Part


def strip(material="gel", **others):
    """A bilayer strip on a wall."""
    path = StraightPath(start=(0, 0, 0), direction=(1, 0, 0), length="5 cm")
    layers = [
        Layer(name="passive", material="gel", thickness="1 mm"),
        Layer(name="active", material=material, thickness=1e-3, eigenstrain=Eigenstrain(stimulus="heat", gain=0.05)),
    ]
    wall = Body(name="wall", position=(0, 0, 0), motion=Prescribed())
    return Scene(
        name="strip",
        title="Two layers on a wall",
        duration="0.1 s",
        materials={"gel": Material(youngs_modulus="1 MPa", poisson_ratio=0.5, density=1100)},
        stimuli={"heat": Stimulus(schedule=Hold(value=0.5))},
        rods=[
            Rod(name="arm", width="1 cm", path=path, normal=[0, 0, 1], stations=11, layers=layers, clamp_start="wall")
        ],
        bodies=[wall],
        **others,
    )


def test_the_package_has_every_class_of_a_scene():
    assert set(scene_classes.__all__) <= set(bilayer_core.__all__)
    parts = {name for name in dir(bilayer_core) if isinstance(getattr(bilayer_core, name), type(Part))}
    assert parts == set(scene_classes.__all__)


def test_a_scene_of_classes_equals_that_of_its_text_and_runs_alike():
    made = strip()
    loaded = load_scene(scene_content(made))
    assert made == loaded and scene_text(made) == scene_text(loaded)
    assert pickle.loads(pickle.dumps(made)) == copy.deepcopy(made) == made
    states = []
    for scene in (made, loaded):
        simulator = Simulator(scene)
        simulator.run(0.05)
        states.append(simulator.save_state())
    np.testing.assert_array_equal(*states)


def test_a_scene_of_classes_takes_overrides():
    assert load_scene(strip()) == strip()
    assert load_scene(strip(), {"rods.arm.layers.active.thickness": "2 mm"}).rods[0].layers[1].thickness == 2e-3
    with pytest.raises(SceneError, match="did you mean duration"):
        load_scene(strip(), {"durration": 1.0})


def test_keys_with_one_value_and_keys_that_python_has_no_name_for_need_no_detour():
    assert StraightPath(start=(0, 0, 0), direction=(2, 0, 0), length=1).shape == "straight"
    assert list(signature(Layer).parameters)[:3] == ["name", "material", "thickness"]
    assert str(signature(StraightPath)) == "(*, shape='straight', start, direction, length)"
    assert Light(from_direction=(0, 0, 2)) == Light(**{"from": (0, 0, 1)})


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (
            lambda: Layer(name="a", material="gel", thickness="5 kg"),
            'Layer a: thickness: found "5 kg", a quantity in kg',
        ),
        (lambda: Layer(name="a", materal="gel"), "Layer a: materal: unknown key, did you mean material?"),
        (
            lambda: Material(youngs_modulus=1e6, density=1),
            "Material: poisson_ratio: is missing; must be Poisson's ratio",
        ),
        (lambda: strip("jel"), 'Scene strip: rods.arm.layers.active.material: found "jel"; must be one of'),
        (lambda: strip(gravty=1), "gravty: unknown key, did you mean gravity?"),
        (lambda: strip(joints=[{"name": "x"}]), "joints.x"),
    ],
)
def test_faults_are_told_as_those_of_files(make, told):
    with pytest.raises(SceneError) as fault:
        make()
    assert told in str(fault.value)


def test_files_still_need_the_version_and_the_kinds_of_their_parts():
    content = everything()
    del content["schema"]
    with pytest.raises(SceneError, match="schema: is missing"):
        load_scene(content)
    content = everything()
    del content["rods"][0]["path"]["shape"]
    with pytest.raises(SceneError, match="the key 'shape' is missing"):
        load_scene(content)


def test_classes_and_scenes_come_without_numba():
    program = "import bilayer_core, sys; bilayer_core.Rod; bilayer_core.load_scene('gripping'); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert "bilayer_core.scene.rod" in loaded and not {"numba", "matplotlib", "mcap"} & set(loaded)
