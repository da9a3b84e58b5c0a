"""Consoles with few characters, without colours, and paths that never end."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from femtune.cli import main
from femtune.errors import FemtuneError, Notice
from femtune.runs.process import end_marked
from femtune.steps.step import coloured

_DECK = """SOL 103
CEND
METHOD = 1
SPC = 1
BEGIN BULK
EIGRL,1,,,2
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
CBAR,1,1,1,2,0.,1.,0.
PBAR,1,1,1.-4,1.-9,2.-9,1.-9
MAT1,1,2.1+11,,.3,7850.
SPC1,1,123456,1
ENDDATA
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "encoding"), [(("info", "d.bdf"), "cp1252"), (("modes", "d.bdf"), "ascii"), (("run", "--help"), "ascii")]
)
def test_characters_that_a_console_lacks_are_replaced(tmp_path: Path, encoding: str, words: tuple[str, ...]) -> None:
    (tmp_path / "d.bdf").write_text(_DECK)
    command = [sys.executable, "-m", "femtune.cli", *words]
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    ended = subprocess.run(command, check=True, cwd=tmp_path, env=environment, capture_output=True)
    ended.stdout.decode(encoding)
    assert b"Traceback" not in ended.stderr


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
@pytest.mark.parametrize("words", [("check", "größe→.toml"), ("explain", "größe→"), ("info", "größe→.bdf", "--json")])
def test_both_streams_keep_the_encoding_of_the_console(
    words: tuple[str, ...], encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names with characters that it lacks, in errors of the input and of the command line."""
    monkeypatch.chdir(tmp_path)
    written = {}
    for name in ("stdout", "stderr"):
        written[name] = io.BytesIO()
        stream = io.TextIOWrapper(written[name], encoding=encoding, errors="strict", write_through=True)
        monkeypatch.setattr(sys, name, stream)
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    assert ended.value.code == 2
    said = b"".join(stream.getvalue() for stream in written.values()).decode(encoding)
    assert ("gro" if encoding == "ascii" else "größe->") in said


@pytest.mark.skipif(os.name != "posix" or sys.platform == "darwin", reason="names of files are bytes on Linux")
def test_names_that_are_no_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A deck whose name is not UTF-8 is refused with a message, and a folder may have any name."""
    folder = os.fsdecode(os.fsencode(tmp_path) + b"/gr\xf6\xdfe")
    os.mkdir(folder)
    name = os.fsdecode(b"gr\xf6\xdfe.bdf")
    Path(folder, name).write_text(_DECK)
    monkeypatch.chdir(folder)
    with pytest.raises(SystemExit) as ended:
        main(["modes", name])
    assert ended.value.code == 2
    assert "deck.unreadable" in capsys.readouterr().err
    assert end_marked(Path(folder))


def test_warnings_are_not_red_and_nothing_has_a_colour_where_none_is_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    error, warning = FemtuneError("study.list"), Notice("external.moved", "moved")
    red = "\x1b[31m"
    assert red in coloured(error)
    assert red not in coloured(warning)
    monkeypatch.setenv("NO_COLOR", "1")
    assert not any(f"\x1b[3{colour}m" in coloured(one) for one in (error, warning) for colour in range(8))


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is full")
@pytest.mark.parametrize(
    "words", [("info", "d.bdf"), ("modes", "d.bdf", "--json"), ("modes", "absent.toml", "--json"), ("--help",)]
)
@pytest.mark.parametrize("both", [False, True])
def test_output_on_a_full_disk_ends_with_a_message(tmp_path: Path, words: tuple[str, ...], both: bool) -> None:
    (tmp_path / "d.bdf").write_text(_DECK)
    with open("/dev/full", "wb") as full:
        errors = full if both else subprocess.PIPE
        ended = subprocess.run(
            [sys.executable, "-m", "femtune.cli", *words], check=False, cwd=tmp_path, stdout=full, stderr=errors
        )
    assert ended.returncode == 2
    if not both:
        assert b"Traceback" not in ended.stderr
        assert (b"disk-full" in ended.stderr) == ("absent.toml" not in words)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.parametrize("words", [("info", "d.bdf"), ("modes", "d.bdf", "--json"), ("--help",)])
def test_a_reader_that_has_ended_is_told_by_the_exit_code(tmp_path: Path, words: tuple[str, ...]) -> None:
    (tmp_path / "d.bdf").write_text(_DECK)
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as closed:
        ended = subprocess.run(
            [sys.executable, "-m", "femtune.cli", *words], check=False, cwd=tmp_path, stdout=closed,
            stderr=subprocess.PIPE,
        )  # fmt: skip
    assert ended.returncode == 141
    assert b"Traceback" not in ended.stderr


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.parametrize(
    "words", [("info", "p.bdf"), ("check", "p.toml"), ("init", "p.bdf", "p.uff"), ("report", "p.h5")]
)
def test_a_pipe_is_no_input(
    tmp_path: Path, words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in words[1:]:
        os.mkfifo(name)
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    assert ended.value.code == 2
    assert "pipe" in capsys.readouterr().err


def test_warnings_of_libraries_are_not_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def warn(*_: object) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.warn("divide by zero encountered in log", RuntimeWarning, stacklevel=1)

    monkeypatch.setattr(main, "invoke", warn)
    main(["schema"], standalone_mode=False)
    assert capsys.readouterr().err == ""
