"""Modes of the model that tables of FRFs leave out: each frequency must name one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import ErrorCollector
from femtune.files.study_file.residual import FrfResidual

if TYPE_CHECKING:
    from femtune.study.progress import Progress
    from femtune.study.study import Study


def check_left_out_modes(study: Study, progress: Progress) -> None:
    """Solve for the modes that tables of FRFs leave out.

    Raises
    ------
    FemtuneError : ``residual.left-out-mode``, as of an update; several are shown together
    """
    entries = (c.entry for c in study.file.comparisons)
    if not any(isinstance(entry, FrfResidual) and entry.leave_out_modes_hz for entry in entries):
        return
    from femtune.residuals.case import CaseState  # noqa: PLC0415  few studies leave out modes
    from femtune.residuals.frf.asked import AskedFrfs  # noqa: PLC0415

    errors, start = ErrorCollector(), np.zeros(len(study.parameters.free))
    for case in (one.used for one in study.cases):
        if case is None:
            continue
        progress.step(f"modes of {case.name}", 0, None)
        state = CaseState(case, case.configured.at(start))
        for residual in case.residuals:
            if isinstance(residual, AskedFrfs):
                with errors.catch():
                    residual.check_left_out(state)
    errors.raise_if_any()
