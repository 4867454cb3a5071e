"""Results on disk: nothing is lost, nothing is mixed."""

import sqlite3
import subprocess
import sys

import pytest

from bilayer_core.errors import InputError, OutputError
from bilayer_core.studies.sweeps.job import Outcome, Row
from bilayer_core.studies.sweeps.journal import FILE, SCHEMA, Journal

CONTENT = {"scene": "bending", "parameters": {"gain": {"values": [1, 2]}}, "design": "grid"}


def row(number, **values):
    return Row(number, f"key{number}", {"gain": number}, "hash", "0.1.0", metrics={"height": 0.1 * number}, **values)


def test_rows_are_read_again_as_they_were_in_the_order_of_runs(tmp_path):
    given = [row(2), row(0, outcome=Outcome.STOPPED, reason="of it", remedy="more"), row(1, summary={"steps": 3})]
    with Journal(tmp_path, CONTENT) as journal:
        journal.add(given[:1])
        journal.add(given[1:])
    with Journal(tmp_path, CONTENT, resume=True) as journal:
        assert list(journal.rows()) == [given[1], given[2], given[0]]
        assert journal.keys() == {"key0", "key1", "key2"}
        assert list(journal.rows({"key1"})) == [given[2]]


def test_results_that_are_there_are_not_replaced_unless_asked(tmp_path):
    with Journal(tmp_path, CONTENT) as journal:
        journal.add([row(0)])
    with pytest.raises(InputError, match="--resume.*--force.*--out"):
        Journal(tmp_path, CONTENT)
    with Journal(tmp_path, CONTENT, resume=True) as journal:
        assert journal.keys() == {"key0"}
    with Journal(tmp_path, CONTENT, force=True) as journal:
        assert not journal.keys()


@pytest.mark.parametrize("statements", [[], ["PRAGMA journal_mode=WAL"], ["PRAGMA journal_mode=WAL", SCHEMA]])
def test_a_sweep_killed_before_its_first_row_is_resumed(tmp_path, statements):
    (tmp_path / FILE).touch()
    with sqlite3.connect(tmp_path / FILE) as base:
        for statement in statements:
            base.executescript(statement)
    base.close()
    with Journal(tmp_path, CONTENT, resume=True) as journal:
        journal.add([row(0)])
    with pytest.raises(InputError, match="the sweep has changed since its results were begun, in design"):
        Journal(tmp_path, CONTENT | {"design": "list"}, resume=True)


def test_nothing_to_resume_is_said(tmp_path):
    with pytest.raises(InputError, match="no results are there to go on with"):
        Journal(tmp_path, CONTENT, resume=True)
    assert not (tmp_path / FILE).exists()


def test_a_sweep_that_has_changed_is_not_resumed_and_says_where(tmp_path):
    Journal(tmp_path, CONTENT).close()
    with pytest.raises(InputError, match="has changed since its results were begun, in design, samples;"):
        Journal(tmp_path, CONTENT | {"design": "sobol", "samples": 8}, resume=True)
    Journal(tmp_path, dict(reversed(CONTENT.items())), resume=True).close()


def test_a_second_program_cannot_write_the_same_results(tmp_path):
    with Journal(tmp_path, CONTENT):
        for options in ({"resume": True}, {"force": True}):
            with pytest.raises(InputError, match="another program is writing it"):
                Journal(tmp_path, CONTENT, **options)


@pytest.mark.parametrize("content", [b"no database", b"SQLite format 3\0" + b"\xff" * 5000])
def test_a_damaged_journal_is_named(tmp_path, content):
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(InputError, match="is damaged or no journal of a sweep"):
        Journal(tmp_path, CONTENT, resume=True)
    Journal(tmp_path, CONTENT, force=True).close()


def test_rows_of_before_survive_a_program_that_is_killed(tmp_path):
    program = (
        "import os, signal, sys; from pathlib import Path\n"
        "from bilayer_core.studies.sweeps.journal import Journal\n"
        "from bilayer_core.studies.sweeps.job import Row\n"
        f"journal = Journal(Path(sys.argv[1]), {CONTENT!r})\n"
        "for k in range(100):\n"
        "    journal.add([Row(k, f'key{k}', {}, '', '')])\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", program, str(tmp_path)])
    with Journal(tmp_path, CONTENT, resume=True) as journal:
        assert len(journal.keys()) == 100


def test_a_full_disk_is_named_and_keeps_what_there_is(tmp_path):
    with Journal(tmp_path, CONTENT) as journal:
        journal.add([row(0)])
        pages = journal._base.execute("PRAGMA page_count").fetchone()[0]
        journal._base.execute(f"PRAGMA max_page_count={pages}")  # what SQLite takes for a full disk
        with pytest.raises(OutputError, match=f"{FILE}: cannot be written: database or disk is full"):
            journal.add([row(k, reason="long " * 1000) for k in range(1, 100)])
    assert sqlite3.connect(tmp_path / FILE).execute("SELECT count(*) FROM rows").fetchone() == (1,)


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", "[" * 100_000, '{"key": "key0", "number": "many"}', "cos\nsystem\n(S'true'\ntR."],
    ids=["nothing", "list", "mapping", "deep", "kind", "pickle"],
)
def test_rows_of_somebody_else_that_are_none_are_told_as_damage(tmp_path, text):
    with Journal(tmp_path, CONTENT) as journal:
        journal.add([row(0)])
    with sqlite3.connect(tmp_path / FILE) as base:
        base.execute("UPDATE rows SET row = ?", (text,))
    with Journal(tmp_path, CONTENT, resume=True) as journal, pytest.raises(InputError, match="'key0' is damaged"):
        list(journal.rows())


@pytest.mark.parametrize("text", ["", "[1]", "{", "3"])
def test_a_head_that_is_none_is_told_as_damage(tmp_path, text):
    Journal(tmp_path, CONTENT).close()
    with sqlite3.connect(tmp_path / FILE) as base:
        base.execute("UPDATE head SET value = ?", (text,))
    with pytest.raises(InputError, match="is damaged or no journal of a sweep"):
        Journal(tmp_path, CONTENT, resume=True)
