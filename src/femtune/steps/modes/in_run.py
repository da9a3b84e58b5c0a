"""The file for ParaView in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.journal.run_files import VTU_FILE
from femtune.steps.modes.vtu_files import write_vtu_files
from femtune.steps.run.outcomes import Made, Outcomes, Updated
from femtune.study.solved import solutions_of, solved_if_any

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def write_vtu(run: Run, outcomes: Outcomes, made: Made) -> None:
    """Mesh, modes and parameters after the update."""
    if not run.study.file.output.vtu:
        return
    updated = outcomes.of(Updated)
    study, x = updated.study(run.study), updated.parameters.result.x
    solved = solutions_of(updated.at)
    for case in study.cases:
        if case.name not in solved and (solution := solved_if_any(study, case, x)) is not None:
            solved[case.name] = solution
    made.add_files(write_vtu_files(study, x, solved, run.folder / VTU_FILE))
