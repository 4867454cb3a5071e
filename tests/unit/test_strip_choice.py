"""Which rods are strips, by how much that differs from a beam, and what cannot be a strip."""

import pytest
from support.sample_scenes import GEL, GROUND, contact, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.edge_figures import edge_figures
from bilayer_core.model.plan import simplest_model
from bilayer_core.model.plate_section import plate_section
from bilayer_core.model.plate_strip import folding_ratio
from bilayer_core.model.strip_choice import departure, law_of, plates, section_of
from bilayer_core.model.validity import validity_figures

HEAT = {"heat": {"schedule": {"type": "hold", "value": 1}}}


def wide(section="auto", width=0.03, gain=0.006667, swelling="isotropic", more=None, **content):
    """A bilayer of 0.5 mm that is as wide as 60 times that, w²κ/H 36."""
    law = {"stimulus": "heat", "gain": gain}
    layers = [layer("p", 0.25e-3), layer("q", 0.25e-3, eigenstrain=law, swelling=swelling) | (more or {})]
    return scene([rod(layers, 0.2, 41, width=width, section=section)], {"model": "auto"}, stimuli=HEAT, **content)


def chosen(**how):
    loaded = load_scene(wide(**how))
    return section_of(loaded, loaded.rods[0], simplest_model(loaded)[0])


@pytest.mark.parametrize(
    ("how", "section"),
    [
        ({}, "strip"),
        ({"width": 4.5e-3}, "beam"),  # w²κ/H 0.8, 0.6 % off
        ({"width": 7e-3}, "strip"),  # 2, 3 % off
        ({"swelling": "along"}, "strip"),  # its curvature is that of a beam, its stiffness is not
        ({"swelling": "across", "width": 1e-3}, "strip"),  # which a beam does not feel
        ({"section": "beam"}, "beam"),
        ({"more": {"interval": [0, 0.1]}}, "strip"),
        ({"more": {"natural_twist": 2.0}}, "beam"),
        ({"coupling": {"translation": 5.0}}, "beam"),
    ],
)
def test_auto_is_a_strip_where_a_beam_would_be_off_by_more_than_1_percent(how, section):
    assert chosen(**how) == section


def test_check_says_how_a_strip_differs_when_it_folds_and_how_high_it_rises():
    loaded = load_scene(wide(contact=contact(2e-4), obstacles=[GROUND | {"point": [0, 0, -1]}]))
    told = {figure.what: str(figure) for figure in validity_figures(loaded)}
    assert "curls 38 % more than a beam (w²κ/H 36)" in told["a strip as wide, swelling alike in all directions, curls"]
    folds = told["as a strip it swells up to w²κ/H of"]
    assert "36 (at most 8.65 (an eigenstrain of 0.16 %)): beyond, held straighter it may fold" in folds
    assert "2.25 mm across (at most 0.2 mm, the barrier distance)" in told["its section rises by"]
    assert departure(loaded, loaded.rods[0], edge_figures(loaded, loaded.rods[0])).swollen == pytest.approx(
        36.0, rel=1e-3
    )


def test_the_height_of_a_section_is_what_layers_that_swell_across_make_of_it():
    around = {"contact": contact(2e-4), "obstacles": [GROUND | {"point": [0, 0, -1]}]}
    heights = {}
    for swelling, gain in (("across", 0.006667), ("along", 0.006667), ("isotropic", 0.0006667)):
        told = validity_figures(load_scene(wide("strip", swelling=swelling, gain=gain, **around)))
        heights[swelling] = [figure.value for figure in told if figure.what == "its section rises by"]
    assert heights == {"across": ["2.25 mm across"], "along": [], "isotropic": ["0.205 mm across"]}


@pytest.mark.parametrize(("poisson", "ratio"), [(0.5, 8.7), (0.3, 10.7)])
def test_the_width_from_which_on_strips_fold_is_that_of_the_plate(poisson, ratio):
    gel = {"gel": {**GEL, "poisson_ratio": poisson}}
    loaded = load_scene(wide(materials=gel))
    assert folding_ratio(law_of(loaded, loaded.rods[0])) == pytest.approx(ratio, abs=0.1)


def test_the_height_and_the_fold_of_layers_of_unlike_ratio_are_those_of_their_own_law():
    gels = {name: {**GEL, "poisson_ratio": ratio} for name, ratio in (("low", 0.1), ("high", 0.49))}
    content = wide("strip", materials=gels, contact=contact(2e-4), obstacles=[GROUND | {"point": [0, 0, -1]}])
    for own, name in zip(content["rods"][0]["layers"], gels, strict=True):
        own["material"] = name
    loaded = load_scene(content)
    law, told = law_of(loaded, loaded.rods[0]), {figure.what: figure for figure in validity_figures(loaded)}
    limit = folding_ratio(law)
    assert law.folds(1.01 * limit) and not law.folds(0.99 * limit)
    assert f"at most {limit:.3g} (" in told["as a strip it swells up to w²κ/H of"].limit
    natural = plate_section(loaded, loaded.rods[0]).natural(1)
    assert natural.across == pytest.approx(natural.along, rel=1e-12)
    height = 0.006667 * abs(natural.across[0]) * 0.03**2 / 8.0
    assert told["its section rises by"].value == f"{1e3 * height:.3g} mm across"


def test_a_strip_needs_layers_that_are_twisted_alike_by_themselves():
    with pytest.raises(SceneError, match="needs layers with one `natural_twist`: the borders of unlike ones"):
        Simulator(load_scene(wide("strip", more={"natural_twist": 2.0})))


def test_round_rods_are_no_strips():
    tube = {**rod([layer()], section="strip", radius=1e-3), "width": None}
    tube["layers"][0]["thickness"] = None
    with pytest.raises(SceneError, match="needs a rectangular section, and it is round; allowed: beam"):
        Simulator(load_scene(scene([tube], {"model": "auto"})))
    loaded = load_scene(scene([tube | {"section": "auto"}]))
    assert section_of(loaded, loaded.rods[0]) == "beam"


def test_two_rods_cannot_be_strips():
    with pytest.raises(SceneError, match="no part across the width; allowed: laminate"):
        Simulator(load_scene(wide("strip")), model="two_rod")


def test_layers_that_swell_across_need_a_strip():
    with pytest.raises(SceneError, match=r"layers\.q\.swelling.*a beam does not feel it; `section: strip`"):
        load_scene(wide("beam", swelling="across"))


def test_layers_of_unlike_poisson_ratio_are_a_strip_at_any_width():
    """A plate that swells alike in all directions bends as a beam whose moduli are E/(1 − ν)."""
    narrow = wide(width=2.5e-3)  # w²κ/H 0.25
    assert section_of(load_scene(narrow), load_scene(narrow).rods[0]) == "beam"
    moduli, ratios = (1e4, 1e6), (0.3, 0.45)
    narrow["materials"] = {
        name: {"youngs_modulus": modulus, "poisson_ratio": ratio, "density": 1000}
        for name, modulus, ratio in zip("ab", moduli, ratios, strict=True)
    }
    for name, own in zip("ab", narrow["rods"][0]["layers"], strict=True):
        own["material"] = name
    loaded = load_scene(narrow)
    assert section_of(loaded, loaded.rods[0]) == "strip"
    told = {figure.what: figure for figure in plates(loaded, "two_rod")}
    as_beam, as_plate = (
        moduli_ratio / (moduli_ratio**2 + 14.0 * moduli_ratio + 1.0)  # Timoshenko's curvature of equal thicknesses
        for moduli_ratio in (moduli[0] / moduli[1], moduli[0] / moduli[1] * (1.0 - ratios[1]) / (1.0 - ratios[0]))
    )
    found = told["a plate as wide, swelling alike in all directions, would curl"].value
    assert found.startswith(f"{100 * (1.0 - as_plate / as_beam):.2g} % less")


def test_a_beam_whose_layers_swell_along_it_alone_is_told_its_stiffness_and_no_curvature():
    told = [figure.what for figure in validity_figures(load_scene(wide("beam", swelling="along")))]
    assert "a plate as wide and curved would be stiffer in bending by" in told
    assert not any("swelling alike" in what for what in told)


TWISTED = {"more": {"natural_twist": 2.0}}


@pytest.mark.parametrize(
    ("how", "model", "warned"),
    [
        ({}, "auto", ""),
        ({"section": "beam"}, "auto", ""),
        ({}, "two_rod", "model laminate"),
        (TWISTED, "auto", "natural_twist"),
    ],
)
def test_a_run_warns_of_a_wide_rod_that_cannot_be_a_strip(how, model, warned):
    simulator = Simulator(load_scene(wide(**how)), model=model)
    simulator.run(1e-3)
    told = " ".join(simulator.summary()["warnings"])
    assert ("would curl" in told and warned in told) == bool(warned)
    figure = next(
        figure
        for figure in plates(simulator.scene, simulator.plan.model)
        if "swelling alike" in figure.line(figure.where)
    )
    assert bool(figure.outside) == bool(warned)
