"""Fenced blocks of Markdown pages: commands and programs that users paste, and what they print."""

import contextlib
import io
import re
import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path

from bilayer_core.cli import main

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


def pasted(block: Block, known: dict, environment: dict[str, str] | None = None) -> tuple[int, str]:
    """Exit code and output of a block that is pasted in this folder: programs and commands `bilayer` are called in this
    process, which saves the start of another; a shell takes all else, and blocks that start something beside it.

    `known`: names that programs define, for those that follow.
    """
    told = io.StringIO()
    with contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
        if block.info == "python":
            exec(compile(block.text, f"line {block.line}", "exec"), known)
            return 0, told.getvalue()
        for text in [block.text] if "&" in block.text else block.text.splitlines():
            words = shlex.split(text, comments=True)
            if words[:1] == ["bilayer"]:
                code = main(words[1:])
            else:
                shell = subprocess.run(["bash", "-e", "-c", text], env=environment, capture_output=True, text=True)
                code = shell.returncode
                print(shell.stdout, shell.stderr)
            if code and not (code == 1 and words[:2] == ["bilayer", "compare"]):  # by which it says that runs differ
                return code, told.getvalue()
    return 0, told.getvalue()


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
