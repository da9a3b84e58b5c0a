"""Completion in a shell: what the Tab key offers."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete, get_completion_class

from femtune.cli import main
from femtune.errors import codes

_INSTALL = Path(__file__).parents[2] / "docs" / "install.md"


def _offered(words: list[str], begun: str) -> list[str]:
    completed = ShellComplete(main, {}, "femtune", "_FEMTUNE_COMPLETE").get_completions(words, begun)
    return [str(item.value) for item in completed]


def test_commands_and_options_are_completed() -> None:
    assert _offered([], "up") == ["update"]
    assert _offered(["run"], "--st") == ["--strict"]
    assert _offered(["run", "--eigensolver"], "s") == ["slepc"]


def test_a_study_is_completed_as_a_file() -> None:
    [item] = ShellComplete(main, {}, "femtune", "_FEMTUNE_COMPLETE").get_completions(["run"], "st")
    assert item.type == "file"


def test_codes_are_completed_with_and_without_the_bracket_of_a_message() -> None:
    expected = [code for code in codes() if code.startswith("deck.missing")]
    assert "deck.missing-include" in expected
    assert _offered(["explain"], "deck.missing") == expected
    assert _offered(["explain"], "[deck.missing") == expected
    assert _offered(["explain"], "nothing-such") == []


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_page_names_a_shell_that_exists(shell: str) -> None:
    assert f"_FEMTUNE_COMPLETE={shell}_source femtune" in _INSTALL.read_text(encoding="utf-8")
    assert get_completion_class(shell) is not None


def test_the_page_names_no_other_shell() -> None:
    named = re.findall(r"_FEMTUNE_COMPLETE=(\w+)_source", _INSTALL.read_text(encoding="utf-8"))
    assert sorted(named) == ["bash", "fish", "zsh"]
