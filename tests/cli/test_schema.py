"""The JSON Schema of scene files accepts what the loader accepts, and tells editors of misspelt keys."""

import copy
import json

import pytest
import yaml
from jsonschema import Draft202012Validator
from support.processes import bilayer

from bilayer_core.scene.bundled import bundled_scenes


@pytest.fixture(scope="module")
def validator():
    found = bilayer("schema")
    assert found.returncode == 0
    schema = json.loads(found.stdout)
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@pytest.mark.parametrize("name", bundled_scenes())
def test_the_schema_accepts_the_bundled_scenes(validator, name):
    scene = yaml.safe_load(bundled_scenes()[name].read_text(encoding="utf-8"))
    assert [error.message for error in validator.iter_errors(scene)] == []


def test_the_schema_refuses_an_unknown_key_and_a_wrong_type(validator):
    good = yaml.safe_load(bundled_scenes()["gripping"].read_text(encoding="utf-8"))
    misspelt, mistyped = copy.deepcopy(good), copy.deepcopy(good)
    misspelt["rods"][0]["widht"] = misspelt["rods"][0].pop("width")
    mistyped["duration"] = [1, 2]
    assert any("widht" in error.message for error in validator.iter_errors(misspelt))
    assert not validator.is_valid(mistyped)
