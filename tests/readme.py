"""The README: its text, its code, the numbers of its table."""

from __future__ import annotations

import re

from touring import ROOT

__all__ = ["README", "blocks", "rows"]

README = (ROOT / "README.md").read_text()
_BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def blocks(language: str) -> list[str]:
    """Return the code blocks of a language."""
    return [text for name, text in _BLOCKS if name == language]


def rows(text: str) -> dict[str, list[float]]:
    """Return the rows of the table: label, identical, independent."""
    found = re.findall(r"^  (\S.*?) {2,}([\d.]+) {2,}([\d.]+) *$", text, re.MULTILINE)
    return {label: [float(value) for value in values] for label, *values in found}
