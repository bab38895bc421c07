"""Files written in one piece."""

import os
import stat
from pathlib import Path

import pytest

from service.whole_file import replace, replace_text


def mode(path: Path) -> int:
    """Return the permissions of a file."""
    return stat.S_IMODE(path.stat().st_mode)


def test_new_files_have_the_permissions_of_any_other(tmp_path: Path) -> None:
    """As a file that is opened for writing; one that was there keeps its own."""
    usual, ours = tmp_path / "usual", tmp_path / "ours"
    usual.touch()
    replace_text(ours, "τ")
    assert mode(ours) == mode(usual)
    ours.chmod(0o640)
    replace_text(ours, "again")
    assert mode(ours) == 0o640
    assert ours.read_text("utf-8") == "again"


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    """And nothing beside it."""
    path = tmp_path / "result"
    path.write_text("before")

    def fail(_file: object) -> None:
        message = "no room"
        raise OSError(message)

    with pytest.raises(OSError, match="no room"):
        replace(path, fail)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_links_and_pipes_are_written_through(tmp_path: Path) -> None:
    """The file that a link names is replaced, the link is not; a device takes what is written."""
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("before")
    link.symlink_to(target)
    replace_text(link, "after")
    assert link.is_symlink()
    assert target.read_text() == "after"
    replace_text(Path(os.devnull), "anything")
