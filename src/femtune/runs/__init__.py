"""Runs of other solvers: input files from templates, a folder a run, outputs that are checked before they are used."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.runs.external import ExternalSolver, FunctionSolver, ResultFile
    from femtune.runs.outcome import Failure, RunOutcome
    from femtune.runs.repeatable import check_repeatable
    from femtune.runs.side_by_side import Evaluated, RunKeeper, evaluate
    from femtune.runs.template import Template, Templates, read_template
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Evaluated",
    "ExternalSolver",
    "Failure",
    "FunctionSolver",
    "ResultFile",
    "RunKeeper",
    "RunOutcome",
    "Template",
    "Templates",
    "check_repeatable",
    "evaluate",
    "read_template",
]
