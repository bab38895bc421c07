"""Blocks of the documentation that can be run, and what they print.

``<!-- run -->`` on the line before a block says that it is run: commands (``sh``) or Python. A
``text`` block behind it is what is printed, where ``...`` stands for lines left out.
``<!-- file: NAME -->`` before a block says that it is the file NAME.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Block", "missing_line", "pages", "runs"]

ROOT = Path(__file__).parent.parent
_BLOCK = re.compile(
    r"^(?:<!-- (?P<mark>run|file: \S+) -->\n)?```(?P<language>\w*)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
_NUMBER = re.compile(r"[+-]?\d+(?:\.(\d*))?(?:e[+-]?\d+)?")
_LAST_DIGITS = 2  # of a printed number that another processor or library may change


@dataclass(frozen=True)
class Block:
    """A block that is run or written, and the lines that it should print."""

    mark: str
    language: str
    text: str
    printed: tuple[str, ...]


def pages() -> list[Path]:
    """Return the pages that have blocks to run."""
    found = [ROOT / "README.md", *ROOT.glob("docs/**/*.md")]
    return sorted(path for path in found if "<!-- run -->" in path.read_text(encoding="utf-8"))


def runs(page: Path) -> list[Block]:
    """Return the marked blocks of a page in their order."""
    found = list(_BLOCK.finditer(page.read_text(encoding="utf-8")))
    blocks = []
    for index, match in enumerate(found):
        if match["mark"] is None:
            continue
        printed: tuple[str, ...] = ()
        if index + 1 < len(found) and found[index + 1]["language"] == "text":
            lines = found[index + 1]["text"].splitlines()
            printed = tuple(line for line in lines if line.strip() not in {"", "..."})
        blocks.append(Block(match["mark"], match["language"], match["text"], printed))
    return blocks


def missing_line(expected: tuple[str, ...], output: str) -> str | None:
    """Return the first expected line that is not printed, in this order; None if all are."""
    lines = iter(output.splitlines())
    for wanted in expected:
        if not any(_alike(wanted.split(), line.split()) for line in lines):
            return wanted
    return None


def _alike(wanted: list[str], printed: list[str]) -> bool:
    return len(wanted) == len(printed) and all(map(_same, wanted, printed))


def _same(wanted: str, printed: str) -> bool:
    """Tell whether two words are the same but for the last digits of numbers in them."""
    if _NUMBER.sub("#", wanted) != _NUMBER.sub("#", printed):
        return False
    for first, second in zip(_NUMBER.finditer(wanted), _NUMBER.finditer(printed), strict=True):
        decimals = len(first[1] or "")
        room = _LAST_DIGITS * 10.0**-decimals if "." in first[0] else 0.0
        if abs(float(first[0]) - float(second[0])) > room * (1 + 1e-9):
            return False
    return True
