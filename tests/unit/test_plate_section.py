"""Sections of laminated plates against closed forms, and against plates solved across their width."""

import math

import numpy as np
import pytest
from oracles.plate_strip_across import Strip, orthotropic
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.plate_section import plate_section
from bilayer_core.model.strip_choice import plate_of
from bilayer_core.model.validity import validity_figures

WIDTH = 20e-3
HEAT = {"stimulus": "heat", "gain": 1e-3}
STIFF = {"along": {"stiffness": 8.0, "swelling": 0.1}, "shear": 1.3}
LIKE = [(1e8, 0.3), (1e8, 0.3)]
UNLIKE = [(1e8, 0.1), (3e8, 0.49)]


def of(*fibres, thickness=(0.1e-3, 0.1e-3), materials=LIKE, section="strip", held=None, **more):
    """A strip of two layers with fibres, each in a material (E, ν) of its own."""
    layers = [
        layer(f"layer{k}", h, f"gel{k}", eigenstrain=HEAT) | ({"fibres": own} if own else {}) | more
        for k, (own, h) in enumerate(zip(fibres, thickness, strict=True))
    ]
    gels = {f"gel{k}": {**GEL, "youngs_modulus": e, "poisson_ratio": nu} for k, (e, nu) in enumerate(materials)}
    return load_scene(
        scene(
            [rod(layers, 0.2, 11, width=WIDTH, section=section, **(held or {}))],
            {"model": "auto", "dimension": "auto"},
            materials=gels,
            bodies=[fixed()],
            stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}},
        )
    )


def section_of(*fibres, **more):
    loaded = of(*fibres, **more)
    return plate_section(loaded, loaded.rods[0])


def solved(*fibres, thickness=(0.1e-3, 0.1e-3), materials=LIKE, gain=1e-3):
    """The same strip as a plate."""
    layers = []
    for own, h, (e, nu) in zip(fibres, thickness, materials, strict=True):
        own = own or {}
        along, across = own.get("along", {}), own.get("across", {})
        shear = own.get("shear", 1.0) * e / (2.0 * (1.0 + nu))
        stiff = orthotropic(e * along.get("stiffness", 1.0), e * across.get("stiffness", 1.0), nu, shear)
        swelling = gain * along.get("swelling", 1.0), gain * across.get("swelling", 1.0)
        layers.append((h, stiff, swelling, own.get("angle", 0.0)))
    return Strip(WIDTH, layers)


@pytest.mark.parametrize("degrees", [-75.0, -30.0, 0.0, 20.0, 45.0, 90.0])
def test_two_crossed_layers_bend_by_the_cosine_and_twist_by_the_sine_of_twice_their_angle(degrees):
    angle, none = math.radians(degrees), {"swelling": 0.0}
    found = section_of({"angle": angle, "across": none}, {"angle": angle + 0.5 * math.pi, "across": none})
    natural = [sum(getattr(found.natural(slot), key) for slot in (0, 1)) for key in ("along", "across", "twist")]
    bend, twist = 1.5 / 0.2e-3 * np.array([math.cos(2.0 * angle), math.sin(2.0 * angle)])
    assert np.ravel(natural) == pytest.approx([bend, -bend, twist], abs=1e-8)


def test_isotropic_layers_of_one_ratio_have_the_section_of_a_beam():
    found = section_of(None, None, thickness=(0.1e-3, 0.3e-3), materials=((3e8, 0.4), (1e8, 0.4)))
    assert np.ravel(found.growth) == pytest.approx([1.0, 1.0, 1.0, 1.0], rel=1e-12)
    rest = np.ravel([*found.across, found.offset, found.pulled])
    assert rest == pytest.approx([0.4, 0.0, 0.0, 0.0], abs=1e-12)
    assert found.plate == pytest.approx(found.narrow[0] / (1.0 - 0.4**2), rel=1e-12)


def test_a_layer_that_swells_more_towards_one_face_bends_away_from_it_in_all_directions():
    one = section_of(None, thickness=(0.1e-3,), materials=LIKE[:1]).natural(0, gradient=True)
    found = np.ravel([one.strain, one.along, one.across, one.twist])
    assert found == pytest.approx([0.0, -1e4, -1e4, 0.0], abs=1e-8)


GAIN, STEP = 1e-5, 2e-2
"""Eigenstrain and curvature [1/m] of narrow strips: w²κ/H is 0.05."""
PLATES = {
    "crossed stiff fibres": ([{"angle": 0.5, **STIFF}, {"angle": -1.1, **STIFF}], {}),
    "fibres in one layer": ([None, {"angle": 0.7, **STIFF}], {"thickness": (0.15e-3, 0.05e-3), "materials": UNLIKE}),
    "unlike ratios": ([None, None], {"materials": UNLIKE}),
}


@pytest.mark.parametrize(("fibres", "more"), PLATES.values(), ids=PLATES)
def test_the_energy_of_a_narrow_strip_is_that_of_a_plate_solved_across_its_width(fibres, more):
    found, plate = section_of(*fibres, **more), solved(*fibres, **more, gain=GAIN)
    natural = np.array([[getattr(found.natural(slot), key)[0] for key in ("along", "twist")] for slot in (0, 1)])
    bend, twist = GAIN * natural.sum(axis=0)

    def energy(kappa, tau):
        own = kappa - bend, tau - twist
        along, both, turned = (part[0] for part in found.narrow)
        return WIDTH * (0.5 * along * own[0] ** 2 + both * own[0] * own[1] + 0.5 * turned * own[1] ** 2)

    for kappa, tau in ((STEP, 0.0), (0.0, STEP), (STEP, STEP), (-STEP, 2.0 * STEP)):
        ends = [of(kappa, tau) - of(0.0, 0.0) for of in (plate.energy, energy)]
        assert ends[0] == pytest.approx(ends[1], rel=1e-4)


def test_a_beam_is_no_plate_and_neither_is_a_strip_of_one_isotropic_material():
    for loaded in (of(None, None), of(None, None, materials=UNLIKE, section="beam")):
        assert plate_of(loaded, loaded.rods[0]) is None


def test_fibres_need_a_strip():
    with pytest.raises(SceneError, match=r"layers\.layer0\.fibres: found 0.5; must be left out: a beam does not feel"):
        of({"angle": 0.5}, None, section="beam")
    loaded = of({"angle": 0.5}, None, section="auto")
    assert plate_of(loaded, loaded.rods[0]) is not None


def test_fibres_say_alone_in_which_direction_their_layer_swells():
    with pytest.raises(SceneError, match=r"swelling: found \"along\"; must be left out: `fibres` say"):
        of({"angle": 0.5}, None, swelling="along")


def test_check_says_to_which_helix_fibres_bend_a_strip_and_what_a_pull_would_do():
    fibres = {"angle": 0.5, **STIFF}, {"angle": -1.1, **STIFF}
    told, found = {figure.what: figure for figure in validity_figures(of(*fibres))}, section_of(*fibres)
    bend, twist = (1e-3 * sum(getattr(found.natural(slot), key)[0] for slot in (0, 1)) for key in ("along", "twist"))
    helix = told["its fibres bend and twist it, where it is narrow, to"]
    assert helix.value.startswith(f"{bend:.3g} and {twist:.3g} 1/m at most (w²κ/H ")
    assert f"pitch {2e3 * math.pi * abs(twist) / (bend**2 + twist**2):.3g} mm" in helix.limit
    pull = told["a pull along it would twist it as well, which is left out:"]
    assert pull.value.startswith(f"{100 * found.pulled[0]:.2g} % ") and not pull.outside
    held = of({"angle": 0.5, **STIFF}, None, held={"clamp_start": "wall", "clamp_end": "wall"})
    (pull,) = (figure for figure in validity_figures(held) if figure.what == pull.what)
    assert pull.outside == "curvature and twist are those without a pull"
