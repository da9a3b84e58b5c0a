"""The criteria requested in `[validate]` of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.validation import profile
from femtune.validation.criteria import (
    DIAGONAL,
    FDAC,
    FRAC,
    FREQUENCY,
    MAC,
    MAX_LEVEL,
    MEAN_LEVEL,
    OF_FRFS,
    OF_VIBRATION,
    OFF_DIAGONAL,
    RESONANCE,
    RMS,
    SHAPE,
    SWEEP_AMPLITUDE,
    SWEEP_FREQUENCY,
    TRANSIENT_PEAK,
)

if TYPE_CHECKING:
    from femtune.study.study import Study
    from femtune.validation import CriteriaProfile, Criterion

_QUANTITIES = {
    "frequency_error": FREQUENCY,
    "mac": MAC,
    "cross_orthogonality": DIAGONAL,
    "off_diagonal": OFF_DIAGONAL,
    "shape_error": SHAPE,
    "frac": FRAC,
    "fdac": FDAC,
    "frf_mean_db": MEAN_LEVEL,
    "frf_max_db": MAX_LEVEL,
    "resonance_error": RESONANCE,
    "sweep_frequency": SWEEP_FREQUENCY,
    "sweep_amplitude": SWEEP_AMPLITUDE,
    "random_rms": RMS,
    "transient_peak": TRANSIENT_PEAK,
}


def criteria_profile(study: Study) -> CriteriaProfile:
    """The profile that the study names, with the limits of the study."""
    table = study.file.validation
    return profile(table.profile, {_QUANTITIES[key]: value for key, value in table.own_limits.items()})


def of_whole_tests(study: Study) -> tuple[Criterion, ...]:
    """Criteria for the modes of a complete test; those for held-out sensors and for FRFs are separate."""
    return tuple(c for c in criteria_profile(study).criteria if c.quantity not in (SHAPE, *OF_FRFS, *OF_VIBRATION))


def of_vibration(study: Study) -> tuple[Criterion, ...]:
    """Criteria for vibration tests."""
    return tuple(c for c in criteria_profile(study).criteria if c.quantity in OF_VIBRATION)


def of_frfs(study: Study) -> tuple[Criterion, ...]:
    """Criteria for measured FRFs."""
    return tuple(c for c in criteria_profile(study).criteria if c.quantity in OF_FRFS)
