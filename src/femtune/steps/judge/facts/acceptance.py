"""What the study asks of an accepted model, as a record."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.correlate.criteria import criteria_profile
from femtune.steps.judge.record.acceptance import AcceptanceResults

if TYPE_CHECKING:
    from femtune.study.study import Study

MOST_LEFT_OUT_PERCENT = 20.0
"""Share of the test modes that may be left uncompared, in %: a judgement, not of a standard."""


def acceptance(study: Study) -> AcceptanceResults:
    """The criteria and the target modes of a study."""
    table = study.file.validation
    return AcceptanceResults(
        chosen=table.profile != "all",
        standard=criteria_profile(study).name,
        target_modes=table.target_modes,
        target_mass_percent=100.0 * table.target_mass,
        left_out_percent=MOST_LEFT_OUT_PERCENT,
    )
