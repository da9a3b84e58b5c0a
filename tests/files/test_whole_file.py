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


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such rights")
def test_a_file_has_the_rights_of_new_files_and_the_process_keeps_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = os.umask(0o027)
    # the mask is that of all threads: a file that another one makes meanwhile would be open to everybody
    monkeypatch.setattr(os, "umask", lambda mask: pytest.fail("the umask of the process was changed"))
    try:
        write_whole(tmp_path / "file", b"text")
        assert (tmp_path / "file").stat().st_mode & 0o777 == 0o640
    finally:
        monkeypatch.undo()
        os.umask(before)
    assert os.listdir(tmp_path) == ["file"]


def test_a_link_is_replaced_and_a_folder_is_not(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("kept")
    (tmp_path / "link").symlink_to("kept")
    write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "kept").read_text() == "kept"
    assert (tmp_path / "link").read_text() == "new"
    for folder in (tmp_path, Path()):
        with pytest.raises(IsADirectoryError):
            write_whole(folder, b"text")
