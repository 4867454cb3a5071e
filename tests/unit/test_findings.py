"""Warnings and figures of one kind are one line: the worst case, its place, and how many others there are."""

import json

import pytest
from support.sample_scenes import contact, fixed, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.cli import main
from bilayer_core.model.findings import Finding, few, told
from bilayer_core.model.plan import make_plan
from bilayer_core.model.validity import validity_figures
from bilayer_core.scene.loader import scene_text


def lines(*severities, kind="hot"):
    return told(
        Finding(kind, f"rods.{name}", ": is hot", severity=s) for name, s in zip("abcdefg", severities, strict=False)
    )


def test_a_single_finding_reads_as_it_is():
    assert lines(1.0) == ("rods.a: is hot",)


def test_equal_findings_share_a_line_with_a_count():
    assert lines(1.0, 1.0) == ("rods.a and rods.b: is hot",)
    assert lines(1.0, 1.0, 1.0) == ("rods.a, rods.b and rods.c: is hot",)
    assert lines(1.0, 1.0, 1.0, 1.0) == ("rods.a, rods.b and 2 more: is hot",)


def test_of_unlike_findings_the_worst_is_told_whatever_its_place_in_the_order():
    assert lines(1.0, 3.0) == ("rods.b (the worst of 2, with rods.a): is hot",)
    assert lines(1.0, 3.0, 2.0, 1.0, 0.5) == ("rods.b (the worst of 5, with rods.a, rods.c and 2 more): is hot",)


def test_several_findings_at_one_place_count_once():
    found = [Finding("hot", "rods.a", f": is {s}", severity=s) for s in (1.0, 2.0)]
    assert told(found) == ("rods.a: is 2.0",)


def test_findings_of_two_kinds_are_two_lines_in_their_order():
    found = [Finding("cold", "a", " is cold"), Finding("hot", "a", " is hot"), Finding("cold", "b", " is cold")]
    assert told(found) == ("a and b is cold", "a is hot")


def test_names_beyond_the_first_are_counted_only_if_there_are_two_or_more():
    assert [few("abcd"[:count]) for count in range(1, 5)] == ["a", "a and b", "a, b and c", "a, b and 2 more"]


def many(count=12, rods=None, width=0.004, **more):
    """Strips over a box, the longest one last but one."""
    lengths = [0.1 + 0.01 * (k if k < count - 1 else 0) for k in range(count)]
    strips = [
        rod([layer(thickness=0.5e-3)], name=f"s{k}", start=(0, 0.02 * k, 0), length=length, width=width)
        for k, length in enumerate(lengths)
    ]
    stone = {"name": "stone", "type": "box", "position": [0, 0, -0.1], "size": [0.1, 0.1, 0.1]}
    settings = {**contact(barrier_distance=1e-4), "rods": rods or False}
    return scene(strips, contact=settings, obstacles=[stone], **more)


def test_warnings_of_many_rods_are_a_line_for_each_kind():
    warnings = make_plan(load_scene(many(width=0.05))).warnings
    assert len(warnings) == 2
    wide, passing = warnings
    assert wide.startswith("rods.s0 (the worst of 12, with rods.s1, rods.s2 and 9 more): length/width 2")
    assert passing.startswith(
        "rods may pass through each other: s0 – s1, s0 – s2 and 64 more (contact.rods is false; by"
    )


def test_pairs_of_rods_in_contact_are_told_by_kind_with_a_count():
    pairs = make_plan(load_scene(many(rods=True))).contact_pairs
    ribbons = "(as flat ribbons with borders)"
    stone = "rods – stone (points all over ribbons against box)"
    assert pairs == (
        stone,
        f"s0 – itself, s1 – itself and 76 more {ribbons}",
    )


def test_figures_within_their_range_tell_the_one_nearest_to_the_limit():
    slender = [line for line in told(validity_figures(load_scene(many()))) if "length/width" in line]
    assert len(slender) == 1 and "the nearest to the limit of 12" in slender[0] and "length/width 25" in slender[0]


@pytest.mark.parametrize("as_json", [False, True])
def test_check_prints_each_kind_once(tmp_path, capsys, as_json):
    path = tmp_path / "many.yaml"
    path.write_text(scene_text(load_scene(many(width=0.05))))
    assert main(["check", str(path), *(["--json"] if as_json else [])]) == 0
    out = capsys.readouterr().out
    if as_json:
        report = json.loads(out)
        assert len(report["warnings"]) == 2 and len(report["within_validity"]) == 1
    else:
        assert out.count("WARNING ") == 2 and out.endswith("no faults, 2 warnings\n")


def test_advice_on_several_rods_is_one_line():
    grown = {"stimulus": "heat", "gain": 0.01}
    strips = [
        rod([layer(eigenstrain=grown)], name=name, start=(0, y, 0), clamp_start="wall", clamp_end="wall")
        for name, y in (("a", 0.0), ("b", 0.1))
    ]
    heat = {"heat": {"schedule": {"type": "hold", "value": 0.0}}}
    warnings = make_plan(load_scene(scene(strips, bodies=[fixed()], stimuli=heat))).warnings
    assert any(line.startswith("rods.a and rods.b: is clamped at both ends and grows, so that") for line in warnings)
