"""What is derived of a part of a scene is made once, and is no part of its value."""

import copy
import pickle

from bilayer_core import load_scene
from bilayer_core.model.plan import make_plan


def test_what_is_derived_is_made_once():
    rod = load_scene("gripping").rods[0]
    made = []
    for _ in range(2):
        assert rod.keep("x", (rod,), lambda: made.append(1) or 7) == 7
    assert len(made) == 1 and rod.copies is rod.copies
    assert rod.keep("x", (), lambda: 8) == 8


def test_copies_that_differ_in_place_alone_are_one_rod():
    rods = {id(copy.rod) for copy in load_scene("gripping").rods[0].copies}
    assert len(rods) == 1


def test_a_used_scene_equals_a_fresh_one_and_is_written_the_same():
    used, fresh = load_scene("gripping"), load_scene("gripping")
    make_plan(used)
    assert used == fresh and fresh == used and used.rods == fresh.rods
    assert used.model_dump_json() == fresh.model_dump_json() and repr(used.rods[0]) == repr(fresh.rods[0])
    make_plan(fresh)
    assert used == fresh and used != load_scene("gripping", {"duration": 1.0})


def test_copies_of_a_used_scene_derive_anew():
    used = load_scene("gripping")
    make_plan(used)
    longer = used.rods[0].model_copy(update={"name": "other"})
    assert [of.name for of in longer.copies] != [of.name for of in used.rods[0].copies]
    for twin in (copy.copy(used), copy.deepcopy(used), pickle.loads(pickle.dumps(used)), used.model_copy()):
        assert vars(twin).keys() == type(used).model_fields.keys() and twin == used
