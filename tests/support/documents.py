"""Fenced blocks of Markdown pages: commands and programs that users paste, and what they print."""

import re
from dataclasses import dataclass
from pathlib import Path

FENCE = re.compile(r"^```(?P<info>[^\n]*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block: what stands after its fence, its text, and the line of the page on which it begins."""

    info: str
    text: str
    line: int


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page, in order."""
    content = page.read_text(encoding="utf-8")
    return [Block(m["info"].strip(), m["text"], content[: m.start()].count("\n") + 1) for m in FENCE.finditer(content)]


def is_told(expected: str, output: str) -> str | None:
    """The first line of `expected` that `output` does not have after the line before it; None if it has all.

    `...` stands for anything on a line; spaces at the ends of lines do not count.
    """
    lines = iter(output.splitlines())
    for wanted in filter(str.strip, expected.splitlines()):
        pattern = re.compile(".*".join(map(re.escape, re.split(r"\s*\.\.\.\s*", wanted.strip()))))
        if not any(pattern.search(line) for line in lines):
            return wanted
    return None
