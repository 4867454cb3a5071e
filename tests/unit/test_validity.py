"""Each warning about the validity of the model: given beyond its limit, and not within it."""

import numpy as np
import pytest
from support.sample_scenes import GEL, ball, contact, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.model.edge_figures import EdgeFigures
from bilayer_core.model.findings import told as told_of
from bilayer_core.model.implausible_numbers import implausible_numbers
from bilayer_core.model.plan import make_plan
from bilayer_core.model.plate_section import plate_section
from bilayer_core.model.strip_choice import law_of
from bilayer_core.model.validity import validity_figures, validity_warnings
from bilayer_core.verification.validate.strips import UNLIKE_RESTS

HEAT = {"heat": {"schedule": {"type": "hold", "value": 1.0}}}


def bilayer(gain=0.01, thickness=0.5e-3, length=0.1, width=0.004, **more):
    """A bilayer of two equal layers; w²κ/H is 0.24 at the default gain, 1.5 gain/H the curvature."""
    layers = [
        layer("passive", thickness=thickness),
        layer("active", thickness=thickness, eigenstrain={"stimulus": "heat", "gain": gain}),
    ]
    return scene([rod(layers, length=length, width=width, stations=51, section="auto")], stimuli=HEAT, **more)


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
        "a plate as wide, swelling alike in all directions, would curl 0.048 % less than computed (w²κ/H 0.24) (at",
        "contact.barrier_distance: 0.1 mm is 0.1 of the least thickness, that of rods.rod (at most 0.5)",
    ):
        assert text in told


def bent_by_nature(width):
    """A strip of one layer, 1 mm thick, that is curved by 5 1/m at rest."""
    layers = [layer(thickness=1e-3, natural_curvature=5.0)]
    return scene([rod(layers, length=0.3, width=width, stations=51, section="auto")])


# Of each warning: a scene within the limit, one beyond, and what the warning says. Curvature × thickness is
# 1.5 times the eigenstrain, w²κ/H is 1.5 (w/H)² times the eigenstrain. Of shear it is that of one material, 0.9 (H/L)².
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
    "plate": (
        bilayer(gain=0.06, width=0.0055),
        bilayer(gain=0.08, width=0.0055),
        "rods.rod: a plate as wide, swelling alike in all directions, would curl 6.9 % less than computed (w²κ/H 3.6) "
        "(at most 5 %): its section bends as well; that of a beam does not",
    ),
    "plate without swelling": (
        bent_by_nature(0.025),
        bent_by_nature(0.05),
        "rods.rod: a plate as wide and curved would be stiffer in bending by 17 % (w²κ/H 13) (at most 5 %): its",
    ),
    "shear": (
        bilayer(length=0.0100, width=0.001, gain=0.0),
        bilayer(length=0.0090, width=0.001, gain=0.0),
        "rods.rod: shear makes 1.1 % of the deflection under a load across (below 1 %): a rod does not shear",
    ),
    "barrier distance": (
        bilayer(contact=contact(barrier_distance=0.49e-3)),
        bilayer(contact=contact(barrier_distance=0.51e-3)),
        "contact.barrier_distance: 0.51 mm is 0.51 of the least thickness, that of rods.rod (at most 0.5): surfaces",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_warning_is_given_beyond_the_limit_and_not_within(case):
    within, beyond, text = CASES[case]
    (found,) = (figure for figure in validity_figures(load_scene(beyond), "two_rod") if str(figure).startswith(text))
    same = [figure for figure in validity_figures(load_scene(within), "two_rod") if figure.limit == found.limit]
    assert [figure.outside for figure in same] == ([] if case == "shear" else [""])  # which is told from its limit on


@pytest.mark.parametrize(("narrow", "told"), [(3.8e-3, 0), (3.7e-3, 1)])
def test_layers_of_unlike_width_in_contact_are_told_of_a_laminate_alone(narrow, told):
    content = bilayer(contact=contact(barrier_distance=1.1e-4))
    content["rods"][0]["layers"][0]["width"] = narrow  # the other has 4 mm
    text = "rods.rod.layers: are 3.7 to 4 mm wide (alike within twice the barrier distance): contact takes them as one"
    for model, times in (("laminate", told), ("two_rod", 0)):
        found = [str(figure) for figure in validity_warnings(load_scene(content), model)]
        assert len(found) == times and all(line.startswith(text) for line in found)


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
    assert "stiffer in bending by 0.1 % (w²κ/H 0.5)" in told(layers, width=0.01)


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


# Of a free strip of equal layers that swell alike, by w²κ/H: curvature over that of a narrow one, by finite elements
# and, for ν = 0.5, by a plate that was solved across its width.
IN_SPACE = {0.3: {2.6: 0.936, 4.3: 0.886, 6.0: 0.862, 10.0: 0.966, 20.0: 1.129}}
OF_A_PLATE = {0.5: {0.5: 0.998, 2.0: 0.971, 4.3: 0.918, 6.0: 0.919, 10.0: 1.156, 36.0: 1.38, 100.0: 1.432}}


def law(lower, upper):
    """The law of a strip of two equal layers with these Poisson's ratios, the lower of which swells, and κ̄ of a narrow
    one over that of layers of one ratio.
    """
    gels = {name: {**GEL, "poisson_ratio": ratio} for name, ratio in (("lower", lower), ("upper", upper))}
    layers = [layer(name, material=name) for name in gels]
    layers[0]["eigenstrain"] = {"stimulus": "heat", "gain": 0.01}
    loaded = load_scene(scene([rod(layers)], stimuli=HEAT, materials=gels))
    return law_of(loaded, loaded.rods[0]), plate_section(loaded, loaded.rods[0]).growth[3][0]


def test_the_curvature_of_a_wide_strip_is_that_of_independent_programs():
    for table, tolerance in ((IN_SPACE, 0.013), (OF_A_PLATE, 0.002)):
        for poisson, figures in table.items():
            computed = law(poisson, poisson)[0].curvature(np.array(list(figures)))
            np.testing.assert_allclose(computed, list(figures.values()), rtol=tolerance)
    for poisson in (0.3, 0.5):
        strip, _ = law(poisson, poisson)
        assert strip.curvature(np.array([1e-3, 1e9])) == pytest.approx([1.0, 1.0 + poisson], abs=0.01)
        assert strip.stiffness(np.array([1e-3, 1e9])) == pytest.approx([1.0, 1.0 / (1.0 - poisson**2)], 1e-3)


def test_layers_of_unlike_ratios_curl_as_a_plate_solved_across_its_width_does():
    strip, narrow = law(0.1, 0.49)
    ratios = np.array(list(UNLIKE_RESTS))
    assert narrow * strip.curvature(narrow * ratios) == pytest.approx(list(UNLIKE_RESTS.values()), rel=1e-3)


def test_a_swollen_strip_folds_from_the_width_on_at_which_its_tangent_turns_negative():
    for poisson, ratio in ((0.5, 8.7), (0.3, 10.7)):
        strip, _ = law(poisson, poisson)
        assert not strip.folds(0.98 * ratio)
        assert strip.folds(1.02 * ratio)


def test_the_deflection_by_shear_is_that_of_timoshenko_and_of_a_slab_between_stiff_films():
    alike = load_scene(bilayer(gain=0.0))
    one = EdgeFigures(alike, alike.rods[0])
    shear_modulus = GEL["youngs_modulus"] / (2.0 * (1.0 + GEL["poisson_ratio"]))
    expected = 1.2 * GEL["youngs_modulus"] * 1e-6 / (12.0 * shear_modulus)  # 6 EI/(5 GA)
    assert one.shear_over_bending() == pytest.approx(expected, rel=1e-12)
    materials = {"gel": {**GEL, "youngs_modulus": 1e5}, "film": {**GEL, "youngs_modulus": 1e9}}
    layers = [layer("slab", thickness=4e-3), layer("film", thickness=1e-5, material="film")]
    two = load_scene(scene([rod(layers)], materials=materials))
    found = EdgeFigures(two, two.rods[0]).shear_over_bending()
    z = np.linspace(0.0, 4.01e-3, 400_001)
    z = 0.5 * (z[1:] + z[:-1])
    modulus = np.where(z < 4e-3, 1e5, 1e9)
    z = z - (modulus * z).sum() / modulus.sum()
    flow = np.cumsum(modulus * z) * (4.01e-3 / len(z))
    expected = (flow**2 * 3.0 / modulus).sum() / (modulus * z**2).sum()  # G = E/3
    assert found == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (
            scene([rod([layer()], width=12.0)]),
            "rods.rod.width is 12 m, more than its length of 0.1 m: is the unit right?",
        ),
        (
            scene([rod([layer(thickness=0.2)])]),
            "rods.rod.layers.only.thickness is 0.2 m, more than its length of 0.1 m: is",
        ),
        (scene([rod([layer()], length=100.0)]), "rods.rod is 100 m long: is the unit right?"),
        (
            scene([rod([layer()])], materials={"gel": {**GEL, "youngs_modulus": 50.0}}),
            "materials.gel.youngs_modulus is 50 Pa, softer than any gel: is the unit right?",
        ),
        (
            scene([rod([layer()])], materials={"gel": {**GEL, "density": 1.0}}),
            "materials.gel.density is 1 kg/m³, lighter than foam: is the unit right?",
        ),
        (bilayer(gain=3.0), "rods.rod has layers that strain by 300 % (`gain` times the channel): is the unit right?"),
        (
            scene([rod([layer()])], gravity=[0, 0, -9810]),
            "gravity is 9.81e+03 m/s², 1e+03 times the Earth's: is the unit",
        ),
        (
            scene([rod([layer()])], bodies=[ball((0, 0, -40), radius=20)], contact=contact()),
            "bodies.ball is 40 m large, 4e+02 times the longest",
        ),
    ],
)
def test_numbers_that_nobody_means_are_questioned_and_no_others(content, text):
    assert [str(one) for one in told_of(implausible_numbers(load_scene(bilayer())))] == []
    (found,) = told_of(implausible_numbers(load_scene(content)))
    assert found.startswith(text)
    assert found in make_plan(load_scene(content)).warnings
