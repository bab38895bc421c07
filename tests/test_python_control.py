"""The page for people who come from python-control: its tasks run, and both sides agree."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = (Path(__file__).parent.parent / "docs" / "python_control.md").read_text()


@pytest.fixture(scope="module")
def after(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict]:
    """What every task leaves behind, each run after those before it."""
    scope: dict = {}
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("page"))
        tasks = re.compile(r"^## (\d+)\.(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
        for title, text in tasks.findall("## 0.\n" + PAGE):
            for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
                exec(block, scope)  # noqa: S102 - our own page
            found[title] = dict(scope)
    return found


def test_there_are_twelve_tasks(after):
    """Each with a block for either library."""
    assert list(after) == [str(number) for number in range(13)]


@pytest.mark.parametrize("task", ["4", "5", "6", "7", "9", "10"])
def test_both_sides_agree(after, task):
    """To the precision of the simulation."""
    ours, theirs = after[task]["ours"], after[task]["theirs"]
    assert np.asarray(ours) == pytest.approx(np.asarray(theirs), rel=1e-5, abs=1e-6)


def test_plants_and_controllers_agree(after):
    """Those of the model are the same objects; dead time is that of the approximation."""
    assert after["2"]["plant"] == after["1"]["plant"]
    at = 0.05j
    assert after["3"]["exact"].element(0, 0)(at) == pytest.approx(after["3"]["delayed"](at))
    assert after["8"]["ours"](at) == pytest.approx(after["8"]["theirs"](at))


def test_the_result_is_robust_and_saved(after):
    """The tuned settings meet the demand that those typed in miss."""
    assert after["11"]["peak"] >= 1
    assert after["11"]["mu"] > 1
    assert after["12"]["tuned"].ok
    assert after["12"]["best"].fun < after["12"]["start"]
    assert after["12"]["response"].y[0, -1] == pytest.approx(1, abs=0.6)
