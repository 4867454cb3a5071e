"""Seeded bugs: that their list fits the sources, and that one is put in, noticed and taken out again."""

import json

import pytest

from bilayer_core.errors import InputError
from bilayer_core.stress import checkout_copy
from bilayer_core.stress.alike import differs
from bilayer_core.stress.case import Outcome, Record
from bilayer_core.stress.mutants import Mutant, mutants
from bilayer_core.stress.mutations import CASE, FILE, LIVES, TEST, Judged, markdown, read_results, run_mutations
from bilayer_core.stress.reached import reached

CHEAP = "encoders: strain in the place of curvature"


def record(outcome, inside=True):
    return Record("beam", "", inside, [], outcome)


def test_every_bug_fits_its_source_once_and_has_tests_that_are_there(root):
    found = mutants()
    assert len(found) >= 30
    for mutant in found.values():
        source = (root / mutant.path).read_text(encoding="utf-8")
        compile(mutant.applied_to(source), mutant.path, "exec")
        assert mutant.tests and all((root / test).is_file() for test in mutant.tests), mutant.name


@pytest.mark.parametrize("source", ["x = 1\n", "x = 2\nx = 2\n"])
def test_a_bug_that_does_not_fit_the_source_once_is_refused(source):
    mutant = Mutant("sign", "forces/stretch.py", "x = 2", "x = -2", "a sign", ())
    with pytest.raises(InputError, match="'sign': bilayer_core/forces/stretch.py has `x = 2` [02] times"):
        mutant.applied_to(source)


def test_an_edit_reaches_what_uses_it_through_other_modules_and_nothing_else(tmp_path):
    files = {
        "contact/law.py": "LIMIT = 2.0\nOTHER = 1.0\ndef force(x):\n    return LIMIT * x\n",
        "forces/friction.py": "from ..contact.law import OTHER, force as of\ndef add(x):\n    return of(x)\n"
        "def energy(x):\n    return OTHER * x\n",
        "forces/drag.py": "from ..contact import law\ndef add(x):\n    return law.LIMIT\n",
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    before = files["contact/law.py"].replace("LIMIT = 2.0", "LIMIT = 3.0")
    found = reached(tmp_path, ("contact", "forces"), "contact/law.py", before)
    used = {("contact/law.py", "LIMIT"), ("contact/law.py", "force"), ("forces/friction.py", "add")}
    assert found == used | {("forces/drag.py", "add")}
    assert reached(tmp_path, ("contact", "forces"), "record/cdr.py", "") == set()


def test_a_case_notices_a_bug_if_it_fails_or_is_no_longer_accurate_in_the_region():
    accurate, stable, refused, failed = map(record, (Outcome.ACCURATE, Outcome.STABLE, Outcome.REFUSED, Outcome.FAILED))
    assert differs(accurate, stable) and differs(accurate, refused) and differs(stable, failed)
    assert not differs(accurate, accurate) and not differs(stable, refused) and not differs(failed, failed)
    assert not differs(record(Outcome.ACCURATE, inside=False), stable)


def test_a_package_without_its_tests_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(checkout_copy, "__file__", str(tmp_path / "bilayer_core" / "stress" / "checkout_copy.py"))
    with pytest.raises(InputError, match="has no .*tests.*; they need a checkout"):
        checkout_copy.checkout()


def test_an_unknown_name_is_refused_before_anything_is_copied(tmp_path):
    with pytest.raises(InputError, match="--only sine: fits no mutant; there are mutants of stretch"):
        run_mutations(["sine"], tmp_path / "out", print)
    assert not (tmp_path / "out").exists()


def test_the_page_names_what_noticed_each_bug_and_what_lives(tmp_path):
    first, second, third = list(mutants().values())[:3]
    results = [
        Judged(first.name, first.digest, TEST, "tests/physics/test_slip.py::test_it_slips[2]", cpu_time=30.0),
        Judged(second.name, second.digest, LIVES),
        Judged(third.name, third.digest, CASE, "all/0012"),
    ]
    lines = [{"commit": "abc1234", "date": "2026-11-23T00:00:00"}, *(vars(result) for result in results)]
    path = tmp_path / FILE
    path.write_text("".join(json.dumps(line) + "\n" for line in lines) + '{"name": "cut', encoding="utf-8")
    page = "\n".join(markdown(path))
    assert "3 bugs" in page and "2 were noticed" in page and f"- {second.name}: {second.bug}" in page
    assert "| `test_it_slips` | 30 s |" in page and "case `all/0012`" in page


@pytest.mark.slow
def test_a_bug_is_noticed_in_a_copy_and_its_result_is_kept(root, tmp_path):
    source = (root / mutants()[CHEAP].path).read_text(encoding="utf-8")
    told = []
    results = run_mutations([CHEAP], tmp_path, told.append, workers=1, with_cases=False)
    assert [result.name for result in told] == [CHEAP]
    assert results[CHEAP].verdict == TEST and results[CHEAP].checked
    assert results[CHEAP].by == "tests/logs/test_encoders.py::test_messages_hold_the_values_of_the_frame"
    assert read_results(tmp_path / FILE)[1] == results
    assert (root / mutants()[CHEAP].path).read_text(encoding="utf-8") == source
    assert run_mutations([CHEAP], tmp_path, told.append, resume=True, workers=1, with_cases=False) == results
    assert len(told) == 1
