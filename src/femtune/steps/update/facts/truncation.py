"""Errors of FRFs by truncation of the modes, as records."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.residuals.frf.truncation import SMALL, truncations
from femtune.study.progress import silent
from femtune.study.record import EndOfUpdate

if TYPE_CHECKING:
    from femtune.residuals import Evaluation
    from femtune.residuals.frf.truncation import Truncation
    from femtune.study.progress import Progress
from femtune.steps.update.record.truncation import FrfTruncation


def frf_truncations(at: Evaluation, stage: EndOfUpdate, progress: Progress = silent) -> tuple[FrfTruncation, ...]:
    """Those of all FRF residuals at an evaluated point of the update."""
    records: list[FrfTruncation] = []
    for state in at.states:
        for one in truncations(state):
            progress.step(f"truncation of the FRFs, {stage}: {state.case.name}", len(records), None)
            records.append(_record(one, stage))
    return tuple(records)


def _record(truncation: Truncation, stage: EndOfUpdate) -> FrfTruncation:
    known = bool(len(truncation.lines_hz))
    return FrfTruncation(
        configuration=truncation.configuration,
        stage=stage,
        modes=truncation.modes,
        modes_to_hz=truncation.reach_hz,
        highest_line_hz=truncation.highest_hz,
        lines_hz=tuple(float(line) for line in truncation.lines_hz),
        largest_sd=truncation.largest if known else None,
        rms_sd=truncation.mean if known else None,
        largest_percent=100.0 * truncation.relative if known else None,
        function=truncation.function,
        line_hz=truncation.line_hz if known else None,
        small=truncation.small,
        missing="" if truncation.small else truncation.lacks,
        limit=truncation.limit,
        sentence=_sentence(truncation, stage),
        reduced_order=truncation.order,
    )


def _sentence(truncation: Truncation, stage: str) -> str:
    if truncation.large is not None:
        return (
            f"{stage} the update, the FRFs are those of a reduced model of order {truncation.order}; they were not "
            f"compared with direct solutions, which take too long for a model with {truncation.large} DOFs; the check "
            "of the reduced model at the end of the update is stated with it"
        )
    if not len(truncation.lines_hz):
        return "the FRFs are solved for directly at each frequency line, without truncation"
    used = "1 mode" if truncation.modes == 1 else f"{truncation.modes} modes"
    used = (
        f"{used} up to {truncation.reach_hz:.4g} Hz"
        if truncation.order is None
        else f"a reduced model of order {truncation.order}"
    )
    error = (
        f"{stage} the update, FRFs of {used} differ from direct solutions at "
        f"{len(truncation.lines_hz)} lines by at most {truncation.largest:.2g} σ of the measured values "
        f"({truncation.function} at {truncation.line_hz:.4g} Hz)"
    )
    if truncation.small:
        return f"{error}, which is small (limit {SMALL:g} σ)"
    limited = f'; "{truncation.limit}" of the residual limits the modes' if truncation.limit else ""
    return f"{error}; missing: {truncation.lacks}{limited}"
