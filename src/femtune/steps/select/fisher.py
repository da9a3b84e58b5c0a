"""Fisher information of FRFs, as records."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.selection import estimated_size
from femtune.selection.expected import ExpectedKnowledge, expected_knowledge
from femtune.study.record import EndOfUpdate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from femtune.residuals import Evaluation
    from femtune.study.study import Study
from femtune.steps.select.record.fisher import FisherResults, KnownParameter


def known_of_frfs(
    study: Study, at: Evaluation, stage: EndOfUpdate, active: Sequence[str] | None = None
) -> ExpectedKnowledge | None:
    """Information of the data at an evaluation; None for studies without residuals of measured FRFs.

    Parameters
    ----------
    active : names of the parameters that the update moved; None: all free ones
    """
    if not any(b.samples is not None for b in at.weighted):
        return None
    parameters = study.parameters
    size = 1.0
    if study.file.residuals.scatter != "stated":
        size = estimated_size(at.jacobian, at.residuals, sum(at.lost.values()))
    names = tuple(p.name for p in parameters.free)
    moving = np.array([active is None or n in active for n in names])
    prior = np.asarray(parameters.prior[1]) * moving
    return expected_knowledge(at, prior, names, size, updated=stage == "after")


def fisher_results(
    study: Study, at: Evaluation, stage: EndOfUpdate, knowledge: ExpectedKnowledge | None,
    active: Sequence[str] | None = None,
) -> FisherResults | None:  # fmt: skip
    """The information at an evaluation as a record; None where there is none.

    Parameters
    ----------
    found, active : from `known_of_frfs`, and as there
    """
    if knowledge is None:
        return None
    parameters = study.parameters
    names = tuple(p.name for p in parameters.free)
    moving = np.array([active is None or n in active for n in names])
    values, jets, known = parameters.values(at.x), parameters.jets(at.x), knowledge.select(moving)
    scale = np.array([_percent(jets[n].grad, i, values[n]) for i, n in enumerate(names) if moving[i]])
    percent = known.together * scale
    return FisherResults(
        stage=stage,
        measured=known.measured,
        misfit=known.misfit,
        parameters=tuple(
            KnownParameter(
                parameter=name, value=float(values[name]), sd_percent=_finite(sd), sd_alone_percent=_finite(alone),
                known=bool(is_known),
            )
            for name, sd, alone, is_known in zip(known.names, percent, known.alone * scale, known.known)
        ),
        groups=known.groups,
        open=known.open,
        sentences=tuple(known.sentences(percent)),
    )  # fmt: skip


def _percent(gradient: np.ndarray, i: int, value: float) -> float:
    """What a change of the normalised parameter is in % of its value."""
    return 100.0 * abs(gradient[i] / value) if value else np.nan


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
