"""What follows from the list of forces, and what a force that is in the list alone does."""

from dataclasses import replace

import pytest
from support.planar_scenes import AHEAD, everything_in_plane
from support.sample_scenes import everything, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.errors import ForceError
from bilayer_core.model import force_list
from bilayer_core.model.build_model import build_model
from bilayer_core.model.force_list import FORCES, Force, Kind
from bilayer_core.model.force_slots import NAMES, slot_of

SPRING = Force("spring", Kind.CONSERVATIVE, "spring.py", lambda _: None)


def test_a_force_that_is_only_in_the_list_is_refused_when_a_scene_needs_it(monkeypatch):
    description = load_scene(scene([rod([layer()])]))
    Simulator(description)
    monkeypatch.setattr(force_list, "FORCES", (*FORCES, SPRING))
    for build in (Simulator, lambda config: Evaluator(build_model(config))):
        with pytest.raises(ForceError, match="force 'spring': is in the list.*no term.*computes it"):
            build(description)
    unneeded = replace(SPRING, skipped=lambda _: "no spring")
    monkeypatch.setattr(force_list, "FORCES", (*FORCES, unneeded))
    assert Simulator(description).plan.terms["spring"] == "skipped: no spring"


def test_the_engine_computes_no_force_that_is_not_in_the_list():
    with pytest.raises(LookupError, match="force 'spring': is not in the list"):
        slot_of("spring")


@pytest.mark.parametrize(
    ("description", "settings"),
    [
        (everything(), {"model": "two_rod"}),
        (everything(), {"model": "laminate"}),
        (everything_in_plane(AHEAD["oblique"]), {"dimension": 2}),
    ],
    ids=["two rods", "laminate", "in a plane"],
)
def test_plan_energies_and_budget_name_the_same_forces(description, settings):
    simulator = Simulator(load_scene(description), budget=True, **settings)
    simulator.run(0.005)
    summary = simulator.summary()
    assert list(summary["terms"]) == [force.name for force in FORCES]
    active = [force for force in FORCES if summary["terms"][force.name] == "active"]
    assert simulator.model.forces == tuple(force.name for force in active if force.kind)
    conserved = [force.name for force in active if force.kind is Kind.CONSERVATIVE]
    assert [name for name in summary["energy"] if name not in ("kinetic", "fluid")] == conserved
    budget = simulator.budget()
    assert list(budget["work"]) == [f.name for f in active if f.kind not in (None, Kind.INERTIAL)]
    assert [name for name in budget["lost"] if name != "numerical"] == [
        force.name for force in active if force.kind is Kind.DISSIPATIVE
    ]


def test_every_force_has_its_formula_in_a_file(root):
    for force in FORCES:
        assert (root / "bilayer_core/forces" / force.formula).is_file()


def test_places_are_those_of_the_list():
    assert NAMES == tuple(force.name for force in FORCES if force.kind)
