"""On data that were not used: criteria and verdicts, what noise explains of a miss, whether residuals are noise."""

from femtune.validate.assess import assess
from femtune.validate.criteria import (
    CRITERIA,
    PROFILES,
    CriteriaProfile,
    Criterion,
    Outcome,
    Verdict,
    judge,
    not_tested,
    profile,
)
from femtune.validate.goodness import GoodnessOfFit, goodness_of_fit
from femtune.validate.prediction import FrequencyMiss, frequency_miss
from femtune.validate.sensors import HeldOutSensors, held_out_sensors

__all__ = [
    "CRITERIA",
    "PROFILES",
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
