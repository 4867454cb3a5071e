"""What the pages tell users to type exists: commands, options, files, links, programs."""

import re
import shlex
from pathlib import Path

import click
import pytest
from support.documents import FENCE, blocks, pasted

from bilayer_core.cli.options import Settings
from bilayer_core.cli.program import program
from bilayer_core.scene.bundled import bundled_scenes

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("README.md", "CHANGELOG.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md")))
PLACEHOLDER = re.compile(r"\b[A-Z]{2,}\b")


def typed_commands(root):
    """Page and words of each command `bilayer ...` in a fenced block."""
    for page in PAGES:
        for block in blocks(root / page):
            if block.info not in ("sh", "sh ros", "console"):
                continue
            for line in block.text.splitlines():
                words = shlex.split(line, comments=True)
                if words and words[0] == "bilayer":
                    yield page, words[1:]


def named_commands(root):
    """Page and words of each command `bilayer ...` in running text; arguments may be missing there."""
    for page in PAGES:
        text = re.sub(r"^```.*?^```$", "", (root / page).read_text(encoding="utf-8"), flags=re.M | re.S)
        for span in re.findall(r"`bilayer (?!_)([^`]+)`", text):
            if not PLACEHOLDER.search(span):
                yield page, span.split()


def test_every_command_of_a_fenced_block_is_understood(root):
    found = list(typed_commands(root))
    assert len(found) > 10
    for page, words in found:
        try:
            program.commands[words[0]].make_context(words[0], words[1:], obj=Settings())
        except (click.ClickException, KeyError) as error:
            pytest.fail(f"{page}: bilayer {' '.join(words)}: {error!r}")


def test_every_command_that_a_page_names_exists_with_its_options(root):
    found = list(named_commands(root))
    assert len(found) > 10
    for page, (verb, *words) in found:
        assert verb in program.commands, f"{page}: there is no bilayer {verb}"
        options = {name for parameter in program.commands[verb].params for name in parameter.opts} | {"--help"}
        unknown = {word.partition("=")[0] for word in words if word.startswith("--")} - options
        assert not unknown, f"{page}: bilayer {verb} has no {unknown}"


@pytest.mark.parametrize("page", PAGES)
def test_every_link_of_a_page_leads_to_a_file(root, page):
    text = FENCE.sub("", (root / page).read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        if not target.startswith("http"):
            assert ((root / page).parent / target).exists(), f"{page}: there is no {target}"


@pytest.mark.parametrize("page", PAGES)
def test_every_file_of_the_code_that_a_page_names_exists(root, page):
    text = (root / page).read_text(encoding="utf-8")
    made = re.findall(r"(?<=^New file )`(\S+)`|^\d+\. `(\S+)`(?=, new:)", text, re.M)
    for name in set(re.findall(r"`((?:\w+/)+\w+\.py)\b", text)) - {name for names in made for name in names}:
        assert any((root / top / name).is_file() for top in ("", "bilayer_core")), f"{page}: there is no {name}"


def test_every_decision_of_the_design_is_short(root):
    lines = (root / "docs/design.md").read_text(encoding="utf-8").splitlines()
    assert max(map(len, lines)) <= 150
    decisions = re.split(r"^(?=\d+\. |#)", "\n".join(lines), flags=re.M)
    decisions = [part.strip() for part in decisions if part[:1].isdigit()]
    assert len(decisions) > 20
    for number, decision in enumerate(decisions, 1):
        assert decision.startswith(f"{number}. ") and len(decision.splitlines()) <= 6, decision


def test_the_notes_of_every_release_are_short(root):
    _, *releases = re.split(r"^## ", (root / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.M)
    assert releases
    for notes in releases:
        lines = notes.splitlines()
        assert len(lines) <= 30 and max(map(len, lines)) <= 210, lines[0]


@pytest.mark.slow
def test_the_readme_is_short_and_its_robot_commands_and_program_run(root, tmp_path, monkeypatch):
    assert (root / "README.md").stat().st_size <= 6000
    monkeypatch.chdir(tmp_path)
    found = {block.info: block for block in blocks(root / "README.md")}
    assert found["sh"].text.startswith("bilayer check curl.yaml")  # the last one
    Path("curl.yaml").write_text(found["yaml"].text, encoding="utf-8")
    code, told = pasted(found["sh"], {})
    assert code == 0 and "no faults, no warnings" in told and Path("curl.png").stat().st_size > 10_000
    assert len(pasted(found["python"], {})[1].splitlines()) >= 3


def test_pictures_are_small_and_each_is_shown_on_a_page(root):
    text = "".join((root / page).read_text(encoding="utf-8") for page in PAGES)
    pictures = [path for path in (root / "docs/images").rglob("*") if path.is_file()]
    assert {path.suffix for path in pictures} == {".png", ".webp"}
    for picture in pictures:
        assert picture.stat().st_size < 300_000, picture
        assert picture.relative_to(root / "docs").as_posix() in text, picture


def test_the_gallery_shows_bundled_scenes(root):
    page = (root / "docs/gallery.md").read_text(encoding="utf-8")
    shown = re.findall(r"^## (\w+)$", page, re.M)
    assert set(shown) <= set(bundled_scenes()) and len(shown) >= 6
    for name in shown:
        assert f"bilayer run {name} --log {name}.mcap" in page
