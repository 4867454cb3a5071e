"""Which rods are strips, by how much that differs from a beam, and what cannot be a strip."""

import math

import pytest
from support.sample_scenes import GROUND, contact, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.edge_figures import edge_figures
from bilayer_core.model.strip_choice import departure, folding_ratio, plates, section_of
from bilayer_core.model.validity import validity_figures

HEAT = {"heat": {"schedule": {"type": "hold", "value": 1}}}


def wide(section="auto", width=0.03, gain=0.006667, swelling="isotropic", more=None, **content):
    """A bilayer of 0.5 mm that is as wide as 60 times that, w²κ/H 36."""
    law = {"stimulus": "heat", "gain": gain}
    layers = [layer("p", 0.25e-3), layer("q", 0.25e-3, eigenstrain=law, swelling=swelling) | (more or {})]
    return scene([rod(layers, 0.2, 41, width=width, section=section)], {"model": "auto"}, stimuli=HEAT, **content)


def chosen(**how):
    loaded = load_scene(wide(**how))
    return section_of(loaded, loaded.rods[0])


@pytest.mark.parametrize(
    ("how", "section"),
    [
        ({}, "strip"),
        ({"width": 4.5e-3}, "beam"),  # w²κ/H 0.8, 0.6 % off
        ({"width": 7e-3}, "strip"),  # 2, 3 % off
        ({"swelling": "along"}, "strip"),  # its curvature is that of a beam, its stiffness is not
        ({"section": "beam"}, "beam"),
        ({"more": {"interval": [0, 0.1]}}, "beam"),
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
    assert departure(loaded.rods[0], edge_figures(loaded, loaded.rods[0])).swollen == pytest.approx(36.0, rel=1e-3)


def test_the_height_of_a_section_is_what_layers_that_swell_across_make_of_it():
    around = {"contact": contact(2e-4), "obstacles": [GROUND | {"point": [0, 0, -1]}]}
    heights = {}
    for swelling, gain in (("across", 0.006667), ("along", 0.006667), ("isotropic", 0.0006667)):
        told = validity_figures(load_scene(wide("strip", swelling=swelling, gain=gain, **around)))
        heights[swelling] = [figure.value for figure in told if figure.what == "its section rises by"]
    assert heights == {"across": ["2.25 mm across"], "along": [], "isotropic": ["0.205 mm across"]}


def test_the_width_from_which_on_strips_fold_is_that_of_the_plate():
    assert folding_ratio(0.5) == pytest.approx(8.7, abs=0.1)
    assert folding_ratio(0.3) == pytest.approx(10.7, abs=0.1)
    assert folding_ratio(0.0) > folding_ratio(0.1)
    assert not math.isnan(folding_ratio(-0.5))


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ({"interval": [0, 0.1]}, "needs layers that cover all of it, and q has an `interval`; allowed: beam"),
        ({"natural_twist": 2.0}, "takes its twist from its path, and q has a `natural_twist`"),
        ({"thickness": {"at": [0, 0.2], "value": [0.2e-3, 0.3e-3]}}, "needs one thickness all along it"),
        ({"stiffness": {"at": [0, 0.2], "value": [1, 2]}}, "needs one stiffness all along it"),
    ],
)
def test_a_strip_that_cannot_be_computed_is_refused_with_the_reason(more, reason):
    with pytest.raises(SceneError, match=reason):
        Simulator(load_scene(wide("strip", more=more)))


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


@pytest.mark.parametrize("section", ["beam", "auto"])
def test_layers_that_swell_across_need_a_strip(section):
    with pytest.raises(SceneError, match=r"layers\.q\.swelling.*a beam does not feel it; `section: strip`"):
        load_scene(wide(section, swelling="across"))


def test_a_beam_whose_layers_swell_along_it_alone_is_told_its_stiffness_and_no_curvature():
    told = [figure.what for figure in validity_figures(load_scene(wide("beam", swelling="along")))]
    assert "a plate as wide and curved would be stiffer in bending by" in told
    assert not any("swelling alike" in what for what in told)


@pytest.mark.parametrize(("how", "warned"), [({}, True), ({"section": "beam"}, False), ({"section": "strip"}, False)])
def test_a_run_warns_of_a_wide_rod_whose_section_nobody_chose(how, warned):
    simulator = Simulator(load_scene(wide(**{"section": None} | how)))
    simulator.run(1e-3)
    told = " ".join(simulator.summary()["warnings"])
    assert ("would curl" in told and "`section: strip`" in told) == warned
    figure = next(figure for figure in plates(simulator.scene) if "swelling alike" in figure.line(figure.where))
    assert bool(figure.outside) == warned
