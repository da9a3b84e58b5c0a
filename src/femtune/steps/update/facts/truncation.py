"""Errors of FRFs by truncation of the modes, as records."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from femtune.residuals.frf.truncation import SMALL, truncations
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.residuals import Evaluation
    from femtune.residuals.frf.truncation import Truncation
    from femtune.study.progress import Progress
from femtune.steps.update.record.truncation import FrfTruncation


def frf_truncations(
    at: Evaluation, stage: Literal["before", "after"], progress: Progress = silent
) -> tuple[FrfTruncation, ...]:
    """Those of all FRF residuals at an evaluated point of the update."""
    found: list[FrfTruncation] = []
    for state in at.states:
        for one in truncations(state):
            progress.step(f"truncation of the FRFs, {stage}: {state.case.name}", len(found), None)
            found.append(_record(one, stage))
    return tuple(found)


def _record(found: Truncation, stage: Literal["before", "after"]) -> FrfTruncation:
    known = bool(len(found.lines_hz))
    return FrfTruncation(
        configuration=found.configuration,
        stage=stage,
        modes=found.modes,
        modes_to_hz=found.reach_hz,
        highest_line_hz=found.highest_hz,
        lines_hz=tuple(float(line) for line in found.lines_hz),
        largest_sd=found.largest if known else None,
        rms_sd=found.mean if known else None,
        largest_percent=100.0 * found.relative if known else None,
        function=found.function,
        line_hz=found.line_hz if known else None,
        small=found.small,
        missing="" if found.small else found.lacks,
        limit=found.limit,
        sentence=_sentence(found, stage),
        reduced_order=found.order,
    )


def _sentence(found: Truncation, stage: str) -> str:
    if found.large is not None:
        return (
            f"{stage} the update, the FRFs are those of a reduced model of order {found.order}; they were not compared "
            f"with direct solutions, which take too long for a model with {found.large} DOFs; the check of the reduced "
            "model at the end of the update is stated with it"
        )
    if not len(found.lines_hz):
        return "the FRFs are solved for directly at each frequency line, without truncation"
    used = "1 mode" if found.modes == 1 else f"{found.modes} modes"
    used = f"{used} up to {found.reach_hz:.4g} Hz" if found.order is None else f"a reduced model of order {found.order}"
    error = (
        f"{stage} the update, FRFs of {used} differ from direct solutions at "
        f"{len(found.lines_hz)} lines by at most {found.largest:.2g} σ of the measured values "
        f"({found.function} at {found.line_hz:.4g} Hz)"
    )
    if found.small:
        return f"{error}, which is small (limit {SMALL:g} σ)"
    limited = f'; "{found.limit}" of the residual limits the modes' if found.limit else ""
    return f"{error}; missing: {found.lacks}{limited}"
