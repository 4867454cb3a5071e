"""The tables of keys say something about every key."""

import re

import pytest

from bilayer_core.cli import main
from bilayer_core.scene.key_notes import json_schema, notes, scene_models
from bilayer_core.scene.key_tables import TAGS, page


def test_the_command_prints_the_tables(capsys):
    assert main(["schema", "--markdown"]) == 0
    assert capsys.readouterr().out == page()


@pytest.mark.parametrize("model", scene_models(), ids=lambda model: model.__name__)
def test_every_key_has_a_description(model):
    missing = model.model_fields.keys() - notes(model).keys() - set(TAGS)
    assert not missing, f"write a string below each of {sorted(missing)} in {model.__name__}"
    assert all(text.endswith(".") for text in notes(model).values())


def test_every_link_of_the_page_leads_to_a_section_of_it():
    sections = [title.lower() for title in re.findall(r"^## (\w+)$", page(), re.M)]
    assert len(sections) == len(set(sections))
    assert set(re.findall(r"\]\(#(\w+)\)", page())) == set(sections)  # and each section is led to


def test_the_page_says_unit_range_default_and_alternatives():
    shown = page()
    for row in (
        "| `radius` | number | m | **required** | > 0 |",
        "| `thickness` | number or [Profile](#profile) | m | none | > 0 |",
        "| `poisson_ratio` | number | 1 | **required** | > -1, ≤ 0.5 |",
        "| `gravity` | list of 3 numbers | m/s^2 | `[0, 0, -9.81]` |",
        "| [Free](#free) or [Guided](#guided) or [Prescribed](#prescribed) |  | **required** | chosen by `type` |",
        "| `layers` | list of [Layer](#layer) |  | **required** | 1 to 2 items |",
        "| `eigenstrain` | [Eigenstrain](#eigenstrain) or list of [Eigenstrain](#eigenstrain) |  | none |",
        "| `torsion` | choice |  | `laminate` | `laminate`, `layers` |",
        "| `type` | choice |  | **required** | `pin`, `hinge`, `universal`, `slide`, `cylinder`, `weld` |",
        "| `shape` | choice |  | **required** | `bow`, `random` |",
        "Stands at `bodies.NAME.motion`, with `type: guided`.",
        "Stands at `rods.NAME.pattern`, with `type: rotation`, the default.",
    ):
        assert row in shown


def test_the_json_schema_describes_keys_and_ranges():
    path = json_schema()["$defs"]["StraightPath"]["properties"]
    assert path["length"]["description"] == "Of the line. A length [m] above 0, such as 1 mm."
    assert json_schema()["$defs"]["Layer"]["properties"]["thickness"]["description"].startswith("Through the bond.")
    assert json_schema()["properties"]["gravity"]["description"] == "Along x, y and z; z is up."
