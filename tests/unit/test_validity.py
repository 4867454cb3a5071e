"""Each warning about the validity of the model: given beyond its limit, and not within it."""

import pytest
from sample_scenes import contact, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.model.validity import validity_figures, validity_warnings

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


def test_without_contact_nothing_is_said_of_distances_and_without_eigenstrain_nothing_of_curvature():
    told = [str(figure) for figure in validity_figures(load_scene(scene([rod([layer()])])))]
    assert len(told) == 1 and "length/width" in told[0]
