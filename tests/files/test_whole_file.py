"""Files that appear whole, and what must not be replaced by one."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from femtune.files.whole_file import write_whole


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such pipes")
def test_a_pipe_is_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OSError, match="a device or a pipe"):
        write_whole(pipe, b"text")
    assert pipe.is_fifo()
    assert os.listdir(tmp_path) == ["pipe"]


def test_a_link_is_replaced_and_a_folder_is_not(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("kept")
    (tmp_path / "link").symlink_to("kept")
    write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "kept").read_text() == "kept"
    assert (tmp_path / "link").read_text() == "new"
    for folder in (tmp_path, Path()):
        with pytest.raises(IsADirectoryError):
            write_whole(folder, b"text")
