"""What is said about run folders that cannot be read or written."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from tests.messages.shown import check_shown

import femtune as ft
from femtune.cli import main
from femtune.cli.guard import BAD_INPUT
from femtune.errors import FemtuneError
from femtune.files.study_file.reading import toml_text
from femtune.steps.correlate.result import CorrelateResult
from femtune.steps.run_folder import check_writable, read_results


def _message(folder: Path) -> str:
    with pytest.raises(FemtuneError) as caught:
        read_results(folder)
    return str(caught.value).replace(str(folder), "RUN")


def test_no_run_folder(tmp_path: Path) -> None:
    check_shown("run.missing", _message(tmp_path))


def test_another_version(tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text('{"schema_version": "7"}')
    check_shown("run.version", _message(tmp_path))
    (tmp_path / "results.json").write_text('{"schema_version": "one"}')
    check_shown("run.version, unknown", _message(tmp_path))


def test_a_cut_file(tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text('{"schema_version": ')
    message = _message(tmp_path)
    assert message.startswith("[run.damaged] results.json is damaged: ")
    assert message.endswith("  at RUN/results.json\n\nhint: run the study again in this folder")


def test_an_unwritable_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FemtuneError) as caught:
        check_writable(tmp_path / "file" / "run")
    check_shown("run.unwritable, an unwritable folder", str(caught.value).replace(str(tmp_path), "RUN"))


@pytest.mark.parametrize(("name", "says"), [("a\x00b", "null"), ("a" * 5000, "too long")])
def test_a_name_that_no_folder_can_have(tmp_path: Path, name: str, says: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        check_writable(tmp_path / name)
    assert caught.value.code == "run.unwritable"
    assert says in caught.value.what


def test_a_comparison_without_a_verdict_has_no_page(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.report(CorrelateResult((), arrays={}), tmp_path / "page.html")
    check_shown("run.no-page", str(caught.value))


def test_a_full_disk_ends_a_command_with_a_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/tmp/femtune-uff-1/one.uff")

    monkeypatch.setattr("femtune.cli.commands.run_step", full)
    (tmp_path / "beam.bdf").touch()
    shown = CliRunner().invoke(main, ["modes", str(tmp_path / "beam.bdf")])
    assert shown.exit_code == BAD_INPUT
    check_shown("run.disk-full", click.unstyle(shown.output).rstrip("\n"))


def test_a_denied_file_ends_a_command_with_a_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), "/home/colleague/beam/springs.inc")

    monkeypatch.setattr("femtune.cli.commands.run_step", denied)
    (tmp_path / "beam.bdf").touch()
    shown = CliRunner().invoke(main, ["modes", str(tmp_path / "beam.bdf")])
    assert shown.exit_code == BAD_INPUT
    check_shown("run.denied", click.unstyle(shown.output).rstrip("\n"))


def test_a_study_in_a_folder_that_is_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: object, **__: object) -> bool:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), "study.toml")

    monkeypatch.setattr(Path, "is_file", denied)
    with pytest.raises(FemtuneError) as caught:
        toml_text(tmp_path / "study.toml")
    assert caught.value.code == "study.missing-file"
    assert "Permission denied" in caught.value.what
