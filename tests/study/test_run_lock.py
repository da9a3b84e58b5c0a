"""One run at a time in a folder; dead holders do not count."""

from __future__ import annotations

import json
import os
import platform
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps import run_lock
from femtune.steps.run_lock import LOCK_FILE, locked

from .cantilever import Bench

_HOLDER = """
import sys, time
from pathlib import Path
from femtune.steps.run_lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def code(folder: Path) -> str:
    try:
        with locked(folder):
            return ""
    except FemtuneError as error:
        return error.code


def signed(folder: Path, **changed: str) -> None:
    text = {"pid": "1", "host": platform.node(), "since": "2026-01-01T00:00:00+00:00", **changed}
    (folder / LOCK_FILE).write_text(json.dumps(text))


def test_a_lock_is_there_while_it_is_held_and_gone_afterwards(tmp_path: Path) -> None:
    with locked(tmp_path):
        assert json.loads((tmp_path / LOCK_FILE).read_text())["pid"] == str(os.getpid())
        assert code(tmp_path) == "run.locked"
        assert (tmp_path / LOCK_FILE).exists()
    assert not list(tmp_path.iterdir())
    with pytest.raises(KeyboardInterrupt), locked(tmp_path):
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_living_process_holds_and_a_killed_one_does_not(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", _HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        with pytest.raises(FemtuneError) as caught, locked(tmp_path):
            pass
        assert caught.value.values["process"] == str(other.pid)
        other.send_signal(signal.SIGKILL)
        other.wait()
        assert (tmp_path / LOCK_FILE).exists()
        assert code(tmp_path) == ""
        assert not (tmp_path / LOCK_FILE).exists()


def test_only_one_of_many_gets_in(tmp_path: Path) -> None:
    inside, most, refused = 0, 0, 0
    guard, gate = threading.Lock(), threading.Barrier(8)

    def enter() -> None:
        nonlocal inside, most, refused
        gate.wait()
        for _ in range(200):
            try:
                with locked(tmp_path):
                    with guard:
                        inside += 1
                        most = max(most, inside)
                    with guard:
                        inside -= 1
            except FemtuneError:
                refused += 1

    threads = [threading.Thread(target=enter) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == 1
    assert refused > 0


def test_another_machine_counts_as_alive(tmp_path: Path) -> None:
    signed(tmp_path, host="elsewhere")
    assert code(tmp_path) == "run.locked"
    assert (tmp_path / LOCK_FILE).exists()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the kernel of Linux has a name")
def test_a_killed_run_of_another_container_is_taken_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    signed(tmp_path, host="5f1c0e6a2b7d", kernel="of another machine")
    assert code(tmp_path) == "run.locked"
    signed(tmp_path, host="5f1c0e6a2b7d", kernel=kernel)
    assert code(tmp_path) == ""
    with locked(tmp_path):
        monkeypatch.setattr(platform, "node", lambda: "5f1c0e6a2b7d")
        assert code(tmp_path) == "run.locked"


@pytest.mark.parametrize("text", ["", "{", "[" * 9999, "[1]", '{"pid": 1}', "\x00\xff", '{"host": "elsewhere"}'])
def test_a_lock_that_says_nothing_is_taken_over(tmp_path: Path, text: str) -> None:
    (tmp_path / LOCK_FILE).write_bytes(text.encode("latin-1"))
    assert code(tmp_path) == ""


def test_a_disk_without_locks_goes_by_the_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(handle: int) -> bool:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(run_lock, "try_lock", none)
    signed(tmp_path, pid=str(os.getpid()))
    assert code(tmp_path) == "run.locked"
    for pid in ("999999999", "9" * 40, "none"):
        signed(tmp_path, pid=pid)
        assert code(tmp_path) == ""


@pytest.mark.parametrize("kind", ["folder", "link", "pipe"])
def test_what_is_no_lock_file_is_not_touched(tmp_path: Path, kind: str) -> None:
    (tmp_path / "other").write_text("mine")
    lock = tmp_path / LOCK_FILE
    if kind == "pipe" and not hasattr(os, "mkfifo"):
        pytest.skip("no pipes here")
    {"folder": lock.mkdir, "link": lambda: lock.symlink_to(tmp_path / "other"), "pipe": lambda: os.mkfifo(lock)}[kind]()
    assert code(tmp_path) == "run.unwritable"
    assert (tmp_path / "other").read_text() == "mine"


@pytest.mark.slow
def test_a_second_run_is_refused_and_spoils_nothing(beam: Bench) -> None:
    study = beam.study()
    first = ft.update(study)
    kept = {p: p.read_bytes() for p in first.folder.iterdir() if p.is_file()}
    with locked(first.folder):
        with pytest.raises(FemtuneError) as caught:
            ft.update(study, fresh=True)
        ft.modes(study)
    assert caught.value.code == "run.locked"
    assert {p: p.read_bytes() for p in first.folder.iterdir() if p.is_file()} == kept
    assert list((first.folder / "journal").iterdir())
