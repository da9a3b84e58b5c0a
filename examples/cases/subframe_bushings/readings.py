"""What the free test alone, and both tests, can tell of the bushings: by three readings of the FRFs.

The Fisher information of the FRFs below a frequency, with one damping ratio, at the values of the deck. Residuals are
differences of the decimal logarithm of the FRFs, phase included, as in the published study.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.model import constant_damping, solve_modes
from femtune.model.response import frf
from structures.subframe_campaign import Laboratory
from structures.subframe_study import EQUALISED, Compared, held_out

STEP, REACH = 1e-4, 2.0
"""Of the differences, in normalised parameters; highest mode, relative to the highest line."""
PUBLISHED = {"free": 0.26, "mass-loaded": 0.44}
"""δ of the calibration sets of the published study after its calibration: what its model leaves of each value."""


@dataclass(frozen=True)
class Reading:
    """Expected standard deviations of the parameters, in % of the value; infinite where the data leave them open.

    Parameters
    ----------
    name : of the reading
    free, both : of the free test alone, and of both tests, by parameter
    """

    name: str
    free: dict[str, float]
    both: dict[str, float]


@dataclass(frozen=True, eq=False)
class _Slopes:
    """Rows of real and imaginary part of log₁₀ H.

    Parameters
    ----------
    rows : (n, k) derivatives by the parameters
    sd : (n,) of the measured values
    published : (n,) of the deviation that the published model leaves
    """

    rows: Reals
    sd: Reals
    published: Reals


Way = Callable[[_Slopes], tuple[Reals, Reals]]
"""Weights of the rows, and standard deviations of their errors."""


def readings(lab: Laboratory, tests: Sequence[Compared]) -> list[Reading]:
    """The readings; the first test is the free one."""
    of_tests = [_slopes(lab, test) for test in tests]
    ways: dict[str, Way] = {
        "weighted by the noise": lambda s: (1.0 / s.sd, s.sd),
        "unweighted, with the noise": lambda s: (np.ones_like(s.sd), s.sd),
        "unweighted, with the deviation of the published model": lambda s: (np.ones_like(s.sd), s.published),
    }
    return [
        Reading(name, *(dict(zip(lab.names, (100.0 * _sd(part, way)).tolist())) for part in (of_tests[:1], of_tests)))
        for name, way in ways.items()
    ]


def _sd(several: Sequence[_Slopes], way: Way) -> Reals:
    """(k,) of least squares with weights w and errors of standard deviation σ: (JᵀJ)⁻¹ JᵀΣJ (JᵀJ)⁻¹, J weighted."""
    J = np.vstack([way(s)[0][:, None] * s.rows for s in several])
    error = np.concatenate([way(s)[0] * way(s)[1] for s in several])
    inverse = np.linalg.pinv(J)
    return np.asarray(np.sqrt(np.sum((inverse * error) ** 2, axis=1)))


def _slopes(lab: Laboratory, test: Compared) -> _Slopes:
    lines = test.measured.lines
    lines = lines[(lines >= test.band_hz[0]) & (lines <= test.band_hz[1])]
    used = [i for i, name in enumerate(lab.outputs) if name not in held_out(lab.outputs)]

    def functions(x: Reals) -> Complexes:
        solved = solve_modes(lab.configured[test.state.name].at(x), None, REACH * lines[-1])
        damping = constant_damping(EQUALISED)
        found = frf(solved, lab.ports(test.state), lines, "accelerance", damping=damping)
        return np.asarray(found.values[used])

    here, size = functions(lab.origin), STEP * np.eye(lab.parameters)
    logs = np.stack([np.log(functions(h) / functions(-h)) for h in size], axis=-1) / (2.0 * STEP * np.log(10.0))
    noise, largest = test.measured, np.abs(here).max(axis=2, keepdims=True)
    sd = np.hypot(noise.relative, noise.floor * largest / np.abs(here)) / np.log(10.0)
    rows = logs.reshape(-1, lab.parameters)
    # δ is the mean of squares of real and imaginary part together
    published = np.full(2 * len(rows), np.sqrt(PUBLISHED[test.state.name] / 2.0))
    return _Slopes(np.vstack([rows.real, rows.imag]), np.tile(sd.ravel(), 2), published)
