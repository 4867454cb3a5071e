"""Layers are drawn where they are, in the colour of their own strain, by whichever model they are computed."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.log.messages.colours import strain_colours
from bilayer_core.log.messages.description_text import from_text, to_text
from bilayer_core.log.messages.encoders import FrameEncoder
from bilayer_core.log.messages.markers import STRAIN_LIMIT
from bilayer_core.log.messages.node_frames import layer_rows
from bilayer_core.log.run.memory import MemoryRecorder
from bilayer_core.view.geometry import ribbon_vertices

ARC = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.05, "angle": 2.0}
STRAIGHT = {"shape": "straight", "start": [0, 0, 0], "direction": [1, 0, 0], "length": 0.1}


def grown(model, path):
    """A strip at rest, of which the thicker upper layer has grown where it is."""
    growth = {"stimulus": "heat", "gain": 0.03}
    layers = [layer("bottom"), layer("top", thickness=2e-3, interval=[0.02, 0.08], eigenstrain=growth)]
    strip = rod(layers, stations=81, clamp_start="wall", name="strip") | {"path": path}
    heat = {"heat": {"schedule": {"type": "hold", "value": 1}}}
    simulator = Simulator(load_scene(scene([strip], bodies=[fixed()], stimuli=heat)), model=model)
    simulator.solve_static()
    return simulator


@pytest.fixture(scope="module", params=[STRAIGHT, ARC], ids=["straight", "arc"])
def both(request):
    return [grown(model, request.param) for model in ("two_rod", "laminate")]


def strains(simulator):
    frame = simulator.frame()
    return {
        layer.name: layer.strain_of(frame.strain[layer.nodes], frame.curvature[layer.nodes])
        for layer in simulator.description.layers
    }


def test_layers_of_a_laminate_have_the_strains_of_two_rods(both):
    bonded, whole = map(strains, both)
    assert list(whole) == list(bonded) == ["strip/bottom", "strip/top"]
    # one of the two is off by half an edge where the upper layer begins and ends
    inside = {"strip/bottom": [*range(2, 14), *range(19, 61), *range(67, 79)], "strip/top": range(3, 45)}
    for name, nodes in inside.items():
        assert whole[name][nodes] == pytest.approx(bonded[name][nodes], abs=3e-5)
    assert whole["strip/top"][24] > 0.02 > 0.012 > whole["strip/bottom"][40] > 0.005


def test_both_models_draw_each_layer_with_its_own_faces(both):
    drawn = []
    for simulator in both:
        memory = MemoryRecorder()
        simulator.run(1e-3, observers=[memory])
        run = memory.run_data()
        layers = zip(run.description.layers, layer_rows(run.description), strict=True)
        drawn.append([ribbon_vertices(la, run.positions[:1, la.nodes], run.material_frames[:1, r]) for la, r in layers])
    assert [layer.shape for layer in drawn[0]] == [layer.shape for layer in drawn[1]]
    # up to where the upper layer begins: two rods lose half an edge of the bend there
    assert drawn[1][0][0, :15] == pytest.approx(drawn[0][0][0, :15], abs=2e-5)
    bottom, top = (vertices[0] for vertices in drawn[1])
    upper, lower = bottom[16:65, :2], top[:, 2:4]  # the face where they meet, as either of them draws it
    np.testing.assert_allclose(upper, lower, atol=1e-8)


def test_markers_of_a_laminate_show_each_layer(both):
    simulator = both[1]
    typestore = get_typestore(Stores.ROS2_KILTED)
    data = FrameEncoder(simulator.description).encode("markers", simulator.frame())
    markers = {m.ns: m for m in typestore.deserialize_cdr(data, "visualization_msgs/msg/MarkerArray").markers}
    own = strains(simulator)
    assert {name for name in markers if name.startswith("strands/")} == {f"strands/{name}" for name in own}
    for name, strain in own.items():
        colours = [(c.r, c.g, c.b, c.a) for c in markers[f"strands/{name}"].colors[::2]]
        np.testing.assert_allclose(colours, strain_colours(strain, STRAIN_LIMIT), atol=1e-6)


def test_a_log_keeps_the_layers(both):
    description = both[1].description
    found = from_text(to_text(description), description.scene_text)
    assert [layer.nodes for layer in found.layers] == [layer.nodes for layer in description.layers]
    for one, other in zip(found.layers, description.layers, strict=True):
        for name in ("width", "thickness", "offset", "curvature"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
