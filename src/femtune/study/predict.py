"""What the update says of frequencies that it did not use: their sensitivity, and the covariance of the parameters."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femtune.correlate import Correlation
from femtune.files.study_file.residual import FrequencyResidualEntry
from femtune.model import EigenSolution
from femtune.residuals import state_at
from femtune.study.cases import StudyCase
from femtune.study.load import Study
from femtune.update import UpdateResult
from femtune.update.covariance import parameter_covariance
from femtune.validate import FrequencyMiss, frequency_miss

Reals = NDArray[np.float64]


def judged_tests(case: StudyCase) -> list[int]:
    """Positions of the test modes that the update did not use and that the model is judged by."""
    if case.modal is None:
        return []
    kept = range(len(case.modal.test)) if case.entry.use == "validation" else case.held.modes
    return sorted(set(kept) - set(case.modal.left_out))


@dataclass(frozen=True)
class Sensitivities:
    """∂(f/f_test)/∂x of the predicted frequencies, by configuration and position of the test mode."""

    found: dict[tuple[str, int], Reals] = field(default_factory=dict)

    def add(self, case: StudyCase, solution: EigenSolution) -> None:
        """Those of a configuration at its solved modes; nothing where it has no mode to judge by."""
        tests = judged_tests(case)
        if case.modal is None or not tests:
            return
        state = state_at(case.modal, solution.point.x, solution)
        groups = tuple(group for group in state.groups if set(group[0]) & set(tests))
        for pair in replace(state, groups=groups).pairs(derivatives=True):
            omega, test = np.sqrt(max(pair.eigenvalue, 0.0)), 2.0 * np.pi * pair.test_hz
            if omega > 0.0:
                self.found[case.name, pair.position] = pair.eigenvalue_gradient / (2.0 * omega * test)


@dataclass(frozen=True)
class Predictions:
    """The update's result as a prediction.

    `covariance` (k, k) is of the normalised parameters; combinations that the data leave open have their prior spread.
    """

    sensitivities: Sensitivities
    covariance: Reals

    def miss(self, study: Study, case: StudyCase, test: int, error: float) -> FrequencyMiss | None:
        """An error of a predicted frequency beside its scatter; None where that is not known."""
        gradient = self.sensitivities.found.get((case.name, test))
        if gradient is None:
            return None
        return frequency_miss(error, gradient, self.covariance, scatter_of_test(study, case, test) or 0.0)

    def misses(self, study: Study, case: StudyCase, c: Correlation) -> list[tuple[int, FrequencyMiss]]:
        """Those of all pairs of a configuration, by position of the test mode."""
        pairs = zip(c.pairing.pairs, c.frequency_errors)
        found = ((p.test, self.miss(study, case, p.test, float(error))) for p, error in pairs)
        return [(test, miss) for test, miss in found if miss is not None]


def predictions(study: Study, result: UpdateResult, sensitivities: Sensitivities) -> Predictions:
    """What the end of an update predicts with.

    The covariance is that of the least-squares estimate with the priors of the parameters beside the data, so that a
    parameter at a bound and an undetermined combination keep a finite spread. Stated scatter is taken as it is, also
    where the residuals are larger: what the model lacks is no noise.
    """
    sd = np.asarray(result.parameters.prior[1], dtype=float)
    at, free = result.after, np.zeros(len(sd), dtype=bool)
    scatter = study.rules.scatter
    r = at.residuals if scatter == "estimated" else np.zeros_like(at.residuals)
    spread = parameter_covariance(r, at.jacobian, at.kinds, np.diag(1.0 / sd), free, sd, scatter=scatter)
    return Predictions(sensitivities, spread.matrix)


def scatter_of_test(study: Study, case: StudyCase, test: int) -> float | None:
    """Relative standard deviation of a measured frequency: of [validate], the test's own, or that of the residuals."""
    stated, residuals = study.file.validation.frequency_sd, study.file.residuals
    if stated is not None:
        return stated
    assert case.modal is not None
    known = case.modal.test.freq_sd_hz
    if known is not None and known[test] > 0.0:
        return float(known[test] / case.modal.test.freq_hz[test])
    if study.file.residual and "frequency_sd" not in residuals.model_fields_set:
        return _scatter_of_tables(study, case)
    if not isinstance(residuals.frequency_sd, float | int) or residuals.frequency_sd == 0:
        return None
    return float(residuals.frequency_sd) / _power(residuals.frequency_form)


def _scatter_of_tables(study: Study, case: StudyCase) -> float | None:
    """What the [[residual]] tables of frequencies say: those of the configuration, else of the others; the largest."""
    entries = [e for e in study.file.residual if isinstance(e, FrequencyResidualEntry)]
    own = [e for e in entries if e.configuration in (None, case.name)]
    return max((e.sd / _power(e.form) for e in own or entries if isinstance(e.sd, float | int)), default=None)


def _power(form: str) -> float:
    """A relative error of ω² is twice that of the frequency."""
    return 2.0 if form == "eigenvalue" else 1.0
