"""The steps of a project: each has a folder, and modules beside the folders are shared by several steps."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from femtune.steps.step import ReportSection, Step

NAMES = (
    "init", "check", "info", "modes", "view", "respond", "plan", "identify", "correlate", "compare", "select",
    "quantify", "intervals", "update", "equalise", "specimens", "screen", "search", "candidates", "bootstrap",
    "posterior", "live", "vibration", "validate", "write", "judge", "run", "report",
)  # fmt: skip
"""Folders of the steps, in the order in which they are listed."""


@cache
def all_steps() -> tuple[Step, ...]:
    """Every step, as its folder declares it."""
    return tuple(import_module(f"femtune.steps.{name}").STEP for name in NAMES)


def front_door() -> dict[str, str]:
    """The module of the function of each step that has a command, by the name of the step."""
    return {s.name: f"femtune.steps.{s.function.partition(':')[0]}" for s in all_steps() if s.command is not None}


def report_sections() -> tuple[ReportSection, ...]:
    """The sections of the report of a run, in their order."""
    return tuple(sorted((section for step in all_steps() for section in step.sections), key=lambda s: s.place))
