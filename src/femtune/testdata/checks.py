"""Quality of test data: what is missing, impossible, or complex where a real mode is expected."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femtune.errors import ErrorCollector, FemtuneError, Notice
from femtune.modal import ModeSet
from femtune.modal.plausible_damping import doubtful_ratios
from femtune.modal.shape_criteria import turn_to_real_axis
from femtune.testdata.modal_test import ModalTest

_LARGEST = 1e30
"""Entry of a shape above which its square overflows in single precision, and the reciprocal of the smallest one."""

_UNIT_LENGTH = 1e-6
"""Error of the length of a unit vector: files have six digits and more."""
LOW_COLLINEARITY = 0.9
"""Phase collinearity below which a shape is reported as complex; shapes of lightly damped structures have 0.95 and
more."""


def check_test(test: ModalTest, *, allow_missing: bool = False) -> tuple[Notice, ...]:
    """All checks of modes and sensors of a test; errors are shown together.

    Parameters
    ----------
    allow_missing : NaN entries of shapes mean "not measured" and are accepted

    Raises
    ------
    FemtuneError : ``test.nan``, ``test.zero-shape``, ``test.shape-size``, ``test.frequency``, ``test.sensor-direction``
    """
    errors = ErrorCollector()
    notices: tuple[Notice, ...] = ()
    if test.modes is not None:
        with errors.catch():
            notices = check_modes(test.modes, allow_missing=allow_missing)
    for sensor in test.sensors:
        with errors.catch():
            _check_unit_vector(str(sensor.label), sensor.direction)
    errors.raise_if_any()
    return notices


def check_modes(modes: ModeSet, *, allow_missing: bool = False) -> tuple[Notice, ...]:
    """Refuse modes that cannot be compared; return what is merely remarkable.

    Raises
    ------
    FemtuneError : ``test.nan`` naming mode and DOF (unless `allow_missing`), ``test.zero-shape`` for a mode
        without any non-zero entry, ``test.frequency`` for frequencies that are not positive
    """
    errors = ErrorCollector()
    for check in (_check_zero, _check_frequencies):
        with errors.catch():
            check(modes)
    if not allow_missing:
        with errors.catch():
            _check_nan(modes)
    errors.raise_if_any()
    return (*_order(modes), *_repeated(modes), *_complexity(modes), *_damping(modes))


def _check_nan(modes: ModeSet) -> None:
    rows, columns = np.nonzero(np.isnan(modes.shapes))
    if rows.size:
        places = [f"mode {modes.labels[j]} at {modes.dofs[i]}" for i, j in zip(rows[:5], columns[:5])]
        raise FemtuneError("test.nan", values={"first": "; ".join(places)}, n_missing=rows.size)


def _check_zero(modes: ModeSet) -> None:
    if not len(modes.dofs):
        # frequencies without shapes
        return
    largest = np.nanmax(np.abs(modes.shapes), axis=0, initial=0.0)
    _check_size(modes, largest)
    empty = [modes.labels[j] for j in np.flatnonzero(largest == 0)]
    if empty:
        raise FemtuneError("test.zero-shape", modes=", ".join(empty))


def _check_size(modes: ModeSet, largest: NDArray[np.float64]) -> None:
    """Squares of entries must neither overflow nor vanish, also where shapes are kept in single precision."""
    odd = (largest > 0) & ((largest < 1.0 / _LARGEST) | (largest > _LARGEST))
    if odd.any():
        raise FemtuneError(
            "test.shape-size",
            values={f"largest of mode {modes.labels[j]}": largest[j] for j in np.flatnonzero(odd)[:5]},
        )


def _check_frequencies(modes: ModeSet) -> None:
    bad = {f"mode {modes.labels[j]}": modes.freq_hz[j] for j in np.flatnonzero(~(modes.freq_hz > 0))}
    if bad:
        raise FemtuneError("test.frequency", values=bad)


def _check_unit_vector(label: str, direction: NDArray[np.float64]) -> None:
    length = float(np.linalg.norm(direction))
    if not abs(length - 1.0) < _UNIT_LENGTH:
        raise FemtuneError(
            "test.sensor-direction",
            values={"direction": " ".join(f"{c:.6g}" for c in direction), "length": length},
            label=label,
        )


def _order(modes: ModeSet) -> Iterator[Notice]:
    if np.any(np.diff(modes.freq_hz) < 0):
        yield Notice("test.unsorted", level="info")


def _repeated(modes: ModeSet) -> Iterator[Notice]:
    order = np.argsort(modes.freq_hz, kind="stable")
    for i, j in itertools.pairwise(order):
        if modes.freq_hz[i] == modes.freq_hz[j]:
            both = f"modes {modes.labels[i]} and {modes.labels[j]}"
            yield Notice("test.repeated-frequency", modes=both, freq_hz=modes.freq_hz[i])


def _complexity(modes: ModeSet) -> Iterator[Notice]:
    if not np.iscomplexobj(modes.shapes):
        return
    for label, shape in zip(modes.labels, modes.shapes.T):
        collinearity = phase_collinearity(shape)
        if collinearity < LOW_COLLINEARITY:
            deviation = mean_phase_deviation_deg(shape)
            yield Notice("test.complex-shape", mode=label, collinearity=collinearity, deviation_deg=deviation)


def _damping(modes: ModeSet) -> Iterator[Notice]:
    """Damping ratios that are negative or larger than those of any structure, told once with the first of them."""
    if modes.damping_ratio is None:
        return
    doubtful = doubtful_ratios(modes.damping_ratio)
    if not len(doubtful):
        return
    values = modes.damping_ratio[doubtful]
    problem = "it is negative"
    if values[0] > 0.0:
        problem = f"more than any structure has; if {values[0]:g} % is meant, write {values[0] / 100.0:g}"
    others = [modes.labels[i] for i in doubtful[1:]]
    shown = ", ".join(others[:_MOST_NAMED]) + (" …" if len(others) > _MOST_NAMED else "")
    more = f" (the same holds for mode{'s' if len(others) > 1 else ''} {shown})" if others else ""
    yield Notice("test.damping-doubtful", mode=modes.labels[doubtful[0]], value=values[0], more=more, problem=problem)


_MOST_NAMED = 8
"""Modes that a notice names."""


def phase_collinearity(shape: NDArray) -> float:
    """How far the entries of a shape lie on one line of the complex plane: 1 for a real mode, 0 for a circle.

    ((λ1 − λ2)/(λ1 + λ2))², λ being the eigenvalues of the scatter of real and imaginary parts (Pappa, Elliott
    and Schenk 1993, "Consistent-mode indicator for the eigensystem realization algorithm"). NaN entries are
    left out.
    """
    x, y = _parts(shape)
    sxx, syy, sxy = x @ x, y @ y, x @ y
    total = sxx + syy
    return float(((sxx - syy) ** 2 + 4 * sxy**2) / total**2) if total > 0 else 1.0


def mean_phase_deviation_deg(shape: NDArray) -> float:
    """Mean angle (degrees) between the entries and their best line, weighted by their amplitudes.

    Reynders, Houbrechts and De Roeck (2012), "Fully automated (operational) modal analysis". NaN entries
    are left out.
    """
    x, y = _parts(shape)
    amplitude = np.hypot(x, y)
    keep = amplitude > 0
    if not keep.any():
        return 0.0
    line = np.linalg.svd(np.column_stack([x, y]), full_matrices=False)[2][0]
    across = np.abs(x * line[1] - y * line[0])[keep]
    along = np.abs(x * line[0] + y * line[1])[keep]
    return float(np.degrees(np.average(np.arctan2(across, along), weights=amplitude[keep])))


def _parts(shape: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    known = np.asarray(shape, dtype=complex)[~np.isnan(shape)]
    return known.real, known.imag


@dataclass(frozen=True, eq=False)
class RealModes:
    """Real shapes taken from complex ones: `phase_rad` (m,) that each was turned by, and `residual` (m,),
    the norm of what was left in the imaginary part over the norm of the shape."""

    modes: ModeSet
    phase_rad: NDArray[np.float64]
    residual: NDArray[np.float64]


def real_modes(modes: ModeSet) -> RealModes:
    """Turn each complex shape to the phase that makes its imaginary part smallest, and keep the real part.

    The phase is half the argument of Σ φ², which is the least-squares line through the entries. Shapes that
    are real already come back unchanged. Of the variance of a complex entry the real part keeps one half: errors of
    real and imaginary part are taken as equal.
    """
    if not np.iscomplexobj(modes.shapes):
        return RealModes(modes, np.zeros(len(modes)), np.zeros(len(modes)))
    turn = turn_to_real_axis(modes.shapes)
    phase, turned = -np.angle(turn), modes.shapes * turn
    size = np.sqrt(np.nansum(np.abs(turned) ** 2, axis=0))
    residual = np.sqrt(np.nansum(turned.imag**2, axis=0)) / np.where(size > 0, size, 1.0)
    modal_a = None if modes.modal_a is None else modes.modal_a * turn**2
    sd = None if modes.shapes_sd is None else modes.shapes_sd / np.sqrt(2.0)
    return RealModes(replace(modes, shapes=turned.real.copy(), shapes_sd=sd, modal_a=modal_a), phase, residual)
