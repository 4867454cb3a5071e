"""What the models leave out of twist, and say beforehand: against least energy and finite elements."""

import numpy as np
import pytest
from oracles.strip_elasticity import clamped_twist
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.model.plan import make_plan
from bilayer_core.model.twisted import HELIX, TwistedRod, helix_error
from bilayer_core.verification.validate.closed_forms import bonded_helix, strip_torsion

CRANK = {"name": "crank", "position": [0.1, 0, 0], "motion": {"type": "prescribed"}}


def strip_content(
    curvature, twist, torsion="laminate", moduli=(1e8, 1e8), thickness=(1e-3, 1e-3), poisson=0.5, gain=0.0, **more
):
    """A clamped strip whose top layer is naturally helical, and a crank that may hold its end."""
    helical = {"natural_curvature": curvature, "natural_twist": twist}
    top = layer("top", thickness[1], "above", **helical, eigenstrain={"stimulus": "heat", "gain": gain})
    settings = {"stations": 61, "torsion": torsion, "clamp_start": "wall"} | more
    materials = {"below": moduli[0], "above": moduli[1]}
    return scene(
        [rod([layer("bottom", thickness[0], "below"), top], **settings)],
        bodies=[fixed(), CRANK],
        materials={name: {**GEL, "youngs_modulus": e, "poisson_ratio": poisson} for name, e in materials.items()},
        stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}},
        solver={"model": "auto", "dimension": "auto"},
    )


def strip(*arguments, **more):
    return load_scene(strip_content(*arguments, **more))


@pytest.mark.parametrize(
    ("moduli", "thickness"),
    [((1e8, 1e8), (1e-3, 1e-3)), ((1e8, 3e7), (0.7e-3, 1.6e-3)), ((1e7, 3e8), (1.5e-3, 0.4e-3))],
)
@pytest.mark.parametrize("natural", [(15.0, 150.0), (-130.0, 90.0), (5.0, 30.0), (60.0, -90.0), (-20.0, 45.0)])
@pytest.mark.parametrize("torsion", ["laminate", "layers"])
def test_the_error_of_one_curve_for_two_helical_layers_is_known_before(moduli, thickness, natural, torsion):
    config = strip(*natural, torsion, moduli, thickness)
    twisted = TwistedRod(config, config.rods[0])
    radius, pitch = bonded_helix(*natural, torsion, moduli, thickness)
    _, chi, tau = twisted._linear(0.0)[:, 30]
    true = [abs(abs(v) / (chi**2 + tau**2) / exact - 1) for v, exact in ((chi, radius), (2 * np.pi * tau, pitch))]
    assert max(twisted.helix_errors()) == pytest.approx(max(true), rel=0.2)


def test_natural_twist_is_computed_by_two_rods_where_one_curve_would_miss_the_helix():
    strong, weak, slight = strip(15.0, 150.0), strip(40.0, 20.0), strip(0.0, 3.0)
    plan = make_plan(strong)
    assert plan.model == "two_rod"
    assert plan.reasons["model"] == "rods.rod: it winds to a helix, which one curve would miss by 11 %"
    for config in (weak, slight):
        assert make_plan(config).model == "laminate" and helix_error(config, config.rods[0]) < HELIX
    forced, asked = (" ".join(make_plan(config, model="laminate").warnings) for config in (strong, weak))
    assert "off by 11 % in radius, 0.15 % in pitch (at most 1 %)" in forced
    assert "in radius" not in asked


def test_a_stimulus_counts_with_natural_twist():
    quiet, driven = strip(100.0, 50.0), strip(100.0, 50.0, gain=0.016)  # which takes 12 of its 12.5 1/m
    assert helix_error(quiet, quiet.rods[0]) < 0.007 < HELIX < helix_error(driven, driven.rods[0])


@pytest.mark.parametrize(
    ("moduli", "poisson", "thickness", "most"),
    [
        ((1e8, 1e8), 0.3, (0.25e-3, 0.25e-3), 1.02),
        ((1e8, 1e8), 0.0, (1e-3, 1e-3), 1.15),
        ((1e8, 1e8), 0.3, (1e-3, 1e-3), 1.15),
        ((1e8, 3e7), 0.3, (0.7e-3, 1.6e-3), 1.25),
    ],
)
def test_what_clamped_ends_hold_back_is_about_that_of_a_strip_in_space(moduli, poisson, thickness, most):
    length, width, shears = 0.06, 0.01, tuple(e / (2 * (1 + poisson)) for e in moduli)
    free = strip_torsion(shears, thickness, width)["laminate"] / length
    held = 1 - free / clamped_twist(moduli, poisson, thickness, width, length)
    config = strip(0.0, 1.0, "laminate", moduli, thickness, poisson, length=length, clamp_end="crank")
    assert 0.95 * held < TwistedRod(config, config.rods[0]).held_back(two_rods=False) < most * held


def test_clamps_that_hold_back_twist_are_told_where_a_rod_twists_in_space():
    def told(dimension=3, **more):
        return " ".join(make_plan(strip(**({"curvature": 0.0, "twist": 3.0} | more)), dimension=dimension).warnings)

    assert "rods.rod: clamped ends hold back about 2.9 % of its twist (at most 2 %)" in told()
    assert "hold back" not in told(length=0.2)
    assert "hold back" not in told(twist=0.0)
    assert "hold back" not in told(dimension=2, twist=0.0)
    content = strip_content(0.0, 0.0, clamp_end="crank")
    for motion, warned in (({"type": "free", "mass": 1e-3, "inertia": [1e-7] * 3}, True), (CRANK["motion"], False)):
        content["bodies"][1] = {**CRANK, "motion": motion}
        warnings = make_plan(load_scene(content), dimension=3).warnings
        assert any("hold back about 5.7 %" in text for text in warnings) == warned


def test_two_rods_hold_back_a_part_by_themselves():
    config = strip(0.0, 3.0)
    twisted = TwistedRod(config, config.rods[0])
    assert twisted.held_back(two_rods=True) < 0.25 * twisted.held_back(two_rods=False)


def test_borders_that_natural_twist_stretches_are_told():
    alone = scene([rod([layer(natural_twist=200.0)])], solver={"model": "laminate"})
    assert "borders" not in " ".join(make_plan(load_scene(alone)).warnings)
    config = strip(100.0, 50.0, "layers")
    # ΣEA w⁴ (τ² − τ̄²)/(360 ΣGJ), τ = τ̄/2: EA 1e3 N, ΣGJ 2.0822e-4 N m²
    assert TwistedRod(config, config.rods[0]).stretch() == pytest.approx(
        1e3 * 1e-8 * (50.0**2 - 2 * 25.0**2) / (360 * 2.0822e-4), rel=1e-4
    )
    assert "changes its torque by up to 17 % (at most 5 %)" in " ".join(make_plan(config).warnings)
    assert "borders" not in " ".join(make_plan(strip(40.0, 20.0)).warnings)
