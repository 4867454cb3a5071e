"""`bilayer validate`: table, files, figures, exit codes."""

import csv
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from bilayer_core.cli import main
from bilayer_core.verification.validate import case_register, case_report
from bilayer_core.verification.validate.validation_case import Case, Result

KEYS = {"case", "computed", "reference", "error", "limit", "pass"}


@pytest.fixture
def few(monkeypatch):
    """Three cases instead of all, the last of which is wrong."""
    cases = (
        Case("first/right", "itself", 0.01, lambda: (1.0, 1.0), "mm"),
        Case("first/near", "itself", 0.01, lambda: (1.001, 1.0), long=True),
        Case("second/wrong", "itself", 0.01, lambda: (1.5, 1.0)),
    )
    monkeypatch.setattr(case_register, "CASES", cases)


def test_the_table_has_a_line_for_each_case_and_the_exit_code_says_that_one_fails(few, tmp_path, capsys):
    assert main(["validate", "--json", str(tmp_path / "table.json")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[-1] for line in lines[1:4]] == ["pass", "pass", "FAIL"]
    assert lines[-1].startswith("3 cases, 1 failed")
    table = json.loads((tmp_path / "table.json").read_text())["cases"]
    assert [line["pass"] for line in table] == [True, True, False]
    assert all(line.keys() >= KEYS for line in table)
    assert table[2]["error"] == pytest.approx(0.5)


def test_all_that_pass_end_with_exit_code_0(few):
    assert main(["validate", "--only", "first"]) == 0


def test_quick_leaves_long_cases_out_and_list_computes_nothing(few, capsys):
    assert main(["validate", "--quick", "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["first/right", "second/wrong"]


def test_a_limit_that_is_broken_is_exit_code_1(monkeypatch):
    strict = [replace(case, limit=1e-12) for case in case_register.select("bending/two_rod/m = 10")]
    monkeypatch.setattr(case_register, "CASES", strict)
    assert main(["validate"]) == 1


def test_a_pattern_that_matches_nothing_is_bad_input(capsys):
    assert main(["validate", "--only", "nonsense"]) == 2
    assert "no case matches 'nonsense'" in capsys.readouterr().err


def test_one_command_makes_figure_3_and_its_tables(tmp_path, capsys):
    assert main(["validate", "--only", "bending", "--out", str(tmp_path)]) == 0
    assert f"wrote {tmp_path / 'fig3.png'}" in capsys.readouterr().out
    assert_drawn(tmp_path / "fig3.png")
    assert not (tmp_path / "fig4.png").exists()
    table = json.loads((tmp_path / "validation.json").read_text())["cases"]
    with (tmp_path / "validation.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == len(table) == len(case_register.select("bending"))
    assert [line["case"] for line in lines] == [line["case"] for line in table]
    assert float(lines[0]["computed"]) == table[0]["computed"]
    assert (tmp_path / "validation.md").read_text().startswith("### bending")


@pytest.mark.verify
def test_figure_4_is_drawn(tmp_path):
    assert main(["validate", "--only", "helix/layers (100, 50)", "--out", str(tmp_path)]) == 0
    assert_drawn(tmp_path / "fig4.png")


def assert_drawn(path):
    """A picture of useful size, mostly white, with ink of several colours."""
    pixels = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3)
    assert len(pixels) > 400_000
    inked = (pixels < 250).any(axis=1)
    assert 0.01 < inked.mean() < 0.6
    assert len(np.unique(pixels[inked] // 64, axis=0)) >= 5


def test_figures_without_matplotlib_are_refused_before_anything_is_computed(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["validate", "--only", "bending", "--out", str(tmp_path)]) == 2
    streams = capsys.readouterr()
    assert "pip install 'bilayer_sim_ros[plot]'" in streams.err
    assert streams.out == ""


def test_a_directory_that_cannot_be_made_is_bad_input(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["validate", "--out", str(tmp_path / "file")]) == 2
    assert "cannot be made a directory" in capsys.readouterr().err


def test_a_page_says_the_same_where_only_rounding_differs():
    case = Case("family/case", "zero", 1e-6, lambda: (0.0, 0.0), scale=1.0)
    pages = {case_report.page([Result(case, noise, 0.0, noise, 0.1)]) for noise in (3e-13, 2e-10)}
    assert len(pages) == 1
    assert "| case | zero | < 1e-08 | 0 | 1e-8 | 1e-06 |" in pages.pop()


def test_a_page_says_once_what_cases_are_held_against_and_which_one_misses_its_limit():
    cases = [Case(f"family/{name}", against, 0.1, lambda: (1.0, 1.0)) for name, against in ("as", "ba", "ca")]
    page = case_report.page(
        [Result(case, 1.0, 1.0, error, 0.1) for case, error in zip(cases, (0.0, 1e-3, 1.0), strict=True)]
    )
    assert [line.split(" | ")[1] for line in page.splitlines()[4:7]] == ["s", "a", ""]
    assert ["missed" in line for line in page.splitlines()[4:7]] == [False, False, True]
