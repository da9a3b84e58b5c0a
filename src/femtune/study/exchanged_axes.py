"""Axes of a test that are exchanged or inverted, although all of its sensors lie at grid points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Reals
from femtune.correlation.sensor_map import axis_changes
from femtune.errors import FemtuneError
from femtune.modal.assignment import linear_sum_assignment
from femtune.study.measured import sensor_map
from femtune.testdata.convert import place

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile
    from femtune.model import EigenSolution
    from femtune.study.cases import StudyCase
    from femtune.testdata import ModalTest

_POOR_MAC = 0.7
"""Mean MAC with the axes of the study below which other axes are tried; above it a fit needs no explanation."""
_GOOD_MAC = 0.85
"""Mean MAC with other axes above which they are proposed. It is well above `_POOR_MAC`, so that a chance improvement
is not proposed."""
_BETTER_BY = 1e-3
"""Increase of the mean MAC that decides between two changes of axes. Symmetric structures have several of equal MAC;
the first one is then kept."""


def fitting_axes(file: StudyFile, case: StudyCase, solution: EigenSolution) -> str:
    """What to write so that the axes of a test fit the mode shapes; "" if the present axes fit, or no others fit
    better.

    The 48 exchanges and inversions of axes are tried where the mean MAC of test modes and model modes of similar
    frequency is below 0.7. One is proposed if the mean MAC is above 0.85 with it and all sensors lie at grid points.
    """
    if case.modal is None or case.test is None or len(case.modal.test) < 2:
        return ""
    alike = _Likeness(case, solution)
    if alike.mean(np.asarray(case.modal.sensors @ alike.free)) >= _POOR_MAC:
        return ""
    xyz = case.configured.model.structure.nodes.xyz
    middle = 0.5 * (xyz.min(axis=0) + xyz.max(axis=0)) if len(xyz) else np.zeros(3)
    best, proposal = _GOOD_MAC, ""
    # rotations first: a study can state them
    changes = sorted(axis_changes(), key=lambda change: np.linalg.det(change[1]) < 0.0)
    for words, matrix in changes:
        # about the origin, and about the middle of the model where coordinates decide
        for shift in (np.zeros(3), middle - matrix @ middle)[: 1 if file.sensors.by_id else 2]:
            value = alike.with_axes(file, case.test, matrix, shift)
            if value > best + _BETTER_BY:
                best, proposal = value, _words(file, case, words, matrix, shift)
    return proposal


def mean_mac(test: Reals, model: Reals, apart: np.ndarray) -> float:
    """Mean MAC of the pairs that have the largest sum; 0 for a test mode without a model mode of its frequency.

    Parameters
    ----------
    test, model : (s, n) and (s, m) shapes at the sensors; NaN where a test shape is not measured
    apart : (n, m) pairs whose frequencies are too different
    """
    known = ~np.isnan(test)
    test = np.where(known, test, 0.0)
    power = (test**2).sum(axis=0)[:, None] * (known.T.astype(float) @ model**2)
    products = (test.T @ model) ** 2
    values = np.divide(products, power, out=np.zeros_like(products), where=power > 0.0)
    values[apart] = 0.0
    return float(values[linear_sum_assignment(-values)].sum() / test.shape[1])


class _Likeness:
    """MAC values between the modes of a test and those of a model at sensors that are placed in different ways."""

    def __init__(self, case: StudyCase, solution: EigenSolution) -> None:
        assert case.modal is not None
        self.case, self.test, self.gate = case, case.modal.test, case.modal.rules.frequency_gate
        self.free = solution.shapes[:, : solution.wanted]
        self.off = np.abs(solution.freq_hz[None, : solution.wanted] / self.test.freq_hz[:, None] - 1.0)

    def mean(self, shapes: Reals) -> float:
        """Mean MAC with these shapes of the model at the sensors."""
        return mean_mac(np.real(self.test.shapes), shapes, self.off > self.gate)

    def with_axes(self, file: StudyFile, test: ModalTest, matrix: Reals, shift: Reals) -> float:
        """The same after a change of axes; 0 if it leaves sensors without grid points."""
        structure = self.case.configured.model.structure
        try:
            sensors = sensor_map(file, place(test, matrix, shift, allow_mirrored=True), structure)
            at, sign = self.test.dofs.align(sensors.dofs)
        except FemtuneError:
            return 0.0
        if sensors.unmatched:
            return 0.0
        rows = sensors.matrix[at] @ self.case.configured.transformation
        return self.mean(sign[:, None] * np.asarray(rows @ self.free))


def _words(file: StudyFile, case: StudyCase, words: str, matrix: Reals, shift: Reals) -> str:
    told = f"the model's X, Y, Z look like the test's {words}"
    if np.linalg.det(matrix) < 0.0:
        return f"{told}, which is no rotation: correct the signs of the sensors in the test"
    rotation = matrix @ np.asarray(case.entry.rotation)
    origin = matrix @ np.asarray(case.entry.origin) + shift
    key = f"rotation = {[[float(x) + 0.0 for x in row] for row in rotation]}"
    if np.abs(origin).max() > 0.0:
        key += f" and origin = {[float(f'{x:.9g}') + 0.0 for x in origin]}"
    return f"{told}: write {key} in {'[[configuration]]' if file.configuration else '[test]'}"
