"""The commands of the command line as functions; `femtune` exports them under the same names.

A name is imported at first use, so that a step loads nothing that only others need.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.steps.files import read_deck, read_matrices, read_test, write_deck, write_test
    from femtune.steps.of_experiments import screen, search
    from femtune.steps.of_model import info, modes, plan, respond, simulate
    from femtune.steps.of_record import identify
    from femtune.steps.of_run import bootstrap, candidates, read_results, run, update, validate
    from femtune.steps.of_start import check, init
    from femtune.steps.of_study import compare, correlate, quantify, select
    from femtune.steps.of_view import view
    from femtune.steps.pages import report
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "bootstrap",
    "candidates",
    "check",
    "compare",
    "correlate",
    "identify",
    "info",
    "init",
    "modes",
    "plan",
    "quantify",
    "read_deck",
    "read_matrices",
    "read_results",
    "read_test",
    "report",
    "respond",
    "run",
    "screen",
    "search",
    "select",
    "simulate",
    "update",
    "validate",
    "view",
    "write_deck",
    "write_test",
]
