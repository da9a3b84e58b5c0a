"""Validation on data that were not used: criteria, verdicts, effect of noise, goodness of fit."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.validation.assessment import assess
    from femtune.validation.criteria import (
        CRITERIA,
        CriteriaProfile,
        Criterion,
        Outcome,
        Verdict,
        judge,
        not_tested,
        profile,
    )
    from femtune.validation.goodness import GoodnessOfFit, goodness_of_fit
    from femtune.validation.prediction import FrequencyMiss, HeldOutSensors, frequency_miss, held_out_sensors
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "CRITERIA",
    "CriteriaProfile",
    "Criterion",
    "FrequencyMiss",
    "GoodnessOfFit",
    "HeldOutSensors",
    "Outcome",
    "Verdict",
    "assess",
    "frequency_miss",
    "goodness_of_fit",
    "held_out_sensors",
    "judge",
    "not_tested",
    "profile",
]
