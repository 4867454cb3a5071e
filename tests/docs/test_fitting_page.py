"""The page about fits: its programs and commands run one after the other, and print what it says."""

import pytest
from support.documents import blocks, is_told, pasted


@pytest.mark.slow
def test_the_programs_and_commands_of_the_page_about_fits_do_what_it_says(root, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = blocks(root / "docs/fitting.md")
    assert [block.info for block in told] == ["python", "sh", "text", "python", "sh", "text"]
    outputs, known = [], {}
    for block, after in zip(told, [*told[1:], None], strict=True):
        if block.info == "text":
            continue
        code, output = pasted(block, known)
        expected = after.text if after is not None and after.info == "text" else ""
        assert bool(code) == expected.startswith("bilayer: nothing was fitted"), output
        assert is_told(expected, output) is None, f"line {block.line}:\n{output}"
        outputs.append(output)
    assert "FitResult(cantilever: materials.gel.youngs_modulus = 1.197 MPa" in outputs[2]
    assert {path.name for path in (tmp_path / "fitted").iterdir()} == {
        "report.json", "residuals.csv", "fitted.yaml", "fit.png",
    }  # fmt: skip
