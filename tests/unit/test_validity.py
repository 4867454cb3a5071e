"""Each warning about the validity of the model: given beyond its limit, and not within it."""

import pytest
from support.sample_scenes import contact, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.model.validity import EdgeFigures, validity_figures, validity_warnings

HEAT = {"heat": {"schedule": {"type": "hold", "value": 1.0}}}


def bilayer(gain=0.01, thickness=0.5e-3, length=0.1, width=0.004, **more):
    """A bilayer of two equal layers; w²κ/H is 0.24 at the default gain, 1.5 gain/H the curvature."""
    layers = [
        layer("passive", thickness=thickness),
        layer("active", thickness=thickness, eigenstrain={"stimulus": "heat", "gain": gain}),
    ]
    return scene([rod(layers, length=length, width=width, stations=51)], stimuli=HEAT, **more)


def warnings(content):
    return list(validity_warnings(load_scene(content)))


def test_a_slender_rod_of_small_strain_has_no_warning_and_all_its_figures_are_told():
    content = bilayer(contact=contact(barrier_distance=1e-4))
    assert warnings(content) == []
    told = "\n".join(map(str, validity_figures(load_scene(content))))
    for text in (
        "length/width 25 (at least 5)",
        "eigenstrain up to 1 % (at most 10 %)",
        "curvature × thickness up to 0.015 (at most 0.2)",
        "w²κ/H up to 0.24 (below 0.5 or above 3)",
        "contact.barrier_distance: 0.1 mm is 0.1 of the least thickness, that of rods.rod (at most 0.5)",
        "edge length 2 mm (at most 2.2 mm",
    ):
        assert text in told


# Of each warning: a scene within the limit, one beyond, and what the warning says. Curvature × thickness is
# 1.5 times the eigenstrain, w²κ/H is 1.5 (w/H)² times the eigenstrain.
CASES = {
    "slenderness": (
        bilayer(length=0.0201, width=0.004, gain=0.0),
        bilayer(length=0.0199, width=0.004, gain=0.0),
        "rods.rod: length/width 5 (at least 5): it is a plate more than a rod",
    ),
    "strain": (
        bilayer(gain=0.0999, width=0.001),
        bilayer(gain=0.101, width=0.001),
        "rods.rod: eigenstrain up to 10.1 % (at most 10 %): the law of the material is linear",
    ),
    "curvature": (
        bilayer(gain=0.133, width=0.001),
        bilayer(gain=0.134, width=0.001),
        "rods.rod: curvature × thickness up to 0.2 (at most 0.2): it is no thin rod",
    ),
    "beam": (
        bilayer(gain=0.0208),
        bilayer(gain=0.0209),
        "rods.rod: w²κ/H up to 0.5 (below 0.5 or above 3): between beam and plate an experiment may be",
    ),
    "plate": (
        bilayer(gain=0.081, width=0.005),
        bilayer(gain=0.079, width=0.005),
        "rods.rod: w²κ/H up to 3 (below 0.5 or above 3): between beam and plate an experiment may be",
    ),
    "barrier distance": (
        bilayer(contact=contact(barrier_distance=0.49e-3)),
        bilayer(contact=contact(barrier_distance=0.51e-3)),
        "contact.barrier_distance: 0.51 mm is 0.51 of the least thickness, that of rods.rod (at most 0.5): surfaces",
    ),
    "edges": (
        bilayer(length=0.109, contact=contact(barrier_distance=1e-4)),
        bilayer(length=0.111, contact=contact(barrier_distance=1e-4)),
        "rods.rod: edge length 2.22 mm (at most 2.2 mm, 2 times least thickness and barrier distance together): only",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_warning_is_given_beyond_the_limit_and_not_within(case):
    within, beyond, text = CASES[case]
    (found,) = (figure for figure in validity_figures(load_scene(beyond)) if str(figure).startswith(text))
    same = [figure for figure in validity_figures(load_scene(within)) if figure.limit == found.limit]
    assert [figure.outside for figure in same] == [""]


def told(layers, **more):
    """Figures of a rod of these layers without contact, as one text."""
    settings = {"length": 0.1, "width": 0.001, "stations": 51} | more
    return "\n".join(map(str, validity_figures(load_scene(scene([rod(layers, **settings)], stimuli=HEAT)))))


def test_the_natural_curvature_of_a_single_layer_counts_without_any_eigenstrain():
    within, beyond = (told([layer(thickness=1e-3, natural_curvature=k)]) for k in (-199.0, 201.0))
    assert "eigenstrain" not in within
    assert "curvature × thickness up to 0.2 (at most 0.2)\n" in within
    assert "curvature × thickness up to 0.2 (at most 0.2): it is no thin rod" in beyond


def test_bonded_layers_bend_by_their_natural_curvatures_weighted_with_their_stiffness():
    """Two equal layers: EI of each is an eighth of the half of D = E w H³/12; the curvature is the mean over four."""
    layers = [layer("bottom", thickness=1e-3), layer("top", thickness=1e-3, natural_curvature=80.0)]
    figures = EdgeFigures(load_scene(scene([rod(layers)])), load_scene(scene([rod(layers)])).rods[0])
    assert figures.natural_change() == pytest.approx(10.0, rel=1e-12)
    assert figures.curvature() == pytest.approx(10.0, rel=1e-12)
    assert "w²κ/H up to 0.5 (below 0.5 or above 3): between beam and plate" in told(layers, width=0.01001)
    assert "w²κ/H up to 0.5 (below 0.5 or above 3)\n" in told(layers, width=0.00999) + "\n"


def test_a_layers_own_sharp_natural_curvature_is_told_though_the_other_holds_it():
    layers = [layer("bottom", thickness=1e-3), layer("top", thickness=1e-3, natural_curvature=201.0)]
    assert "curvature × thickness up to 0.2 (at most 0.2): it is no thin rod" in told(layers)


def test_natural_curvature_and_eigenstrain_add_up():
    swelling = {"stimulus": "heat", "gain": 0.01}
    layers = [layer("bottom", thickness=1e-3), layer("top", thickness=1e-3, natural_curvature=-80.0)]
    assert "curvature × thickness up to 0.08 (at most 0.2)" in told(layers)  # 10 1/m on 2 mm, 80 on 1 mm
    layers[1]["natural_curvature"], layers[1]["eigenstrain"] = -16.0, swelling
    assert "curvature × thickness up to 0.019 (at most 0.2)" in told(layers)  # 2 1/m and 1.5 × 1 % / H


@pytest.mark.parametrize("shape", ["arc", "spiral"])
def test_the_curvature_of_the_path_counts(shape):
    radii = {"radius": 0.01} if shape == "arc" else {"start_radius": 0.02, "end_radius": 0.01}
    path = {"shape": shape, "start": [0, 0, 0], "direction": [1, 0, 0], "angle": 3.0, **radii}
    strip = rod([layer(thickness=1e-3)], width=0.001, stations=101) | {"path": path}
    (text,) = (str(f) for f in validity_figures(load_scene(scene([strip]))) if f.what.startswith("curvature"))
    assert "curvature × thickness up to 0.1 (at most 0.2)" in text


def test_the_natural_curvature_of_a_layer_that_has_the_paths_changes_nothing():
    path = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "angle": 3.0, "radius": 0.01}
    strip = rod([layer(thickness=1e-3, natural_curvature=100.0)], stations=101) | {"path": path}
    config = load_scene(scene([strip]))
    assert EdgeFigures(config, config.rods[0]).natural_change() == pytest.approx(0.0, abs=1e-12)


def test_what_a_scene_lacks_is_not_judged_for_validity():
    told = [str(figure) for figure in validity_figures(load_scene(scene([rod([layer()])])))]
    assert len(told) == 1 and "length/width" in told[0]
