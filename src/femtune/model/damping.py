"""Damping that is no element matrix: modal damping ratios, and the viscous equivalent of loss factors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.fem.structure import OverallDamping
from femtune.model.configured import ModelPoint

DampingUnit = Literal["CRIT", "G", "Q"]


@dataclass(frozen=True, eq=False)
class ModalDamping:
    """Damping ratio ζ of each mode: one for all, a list by mode, or a table over the natural frequency.

    Parameters
    ----------
    values : (n,) damping in `unit`
    freq_hz : (n,) ascending frequencies of a table; a frequency that stands twice is a jump, at which the mean counts
    by_mode : True where the values are those of the modes, one after the other
    unit : "CRIT" ζ, "G" loss factor 2ζ, "Q" quality 1/(2ζ); a table is interpolated in its own unit
    flat : True keeps the first and the last value outside the table; False goes on along its first and last line
    hysteretic : True where a mode's damping is an imaginary stiffness 2ζλ (PARAM KDAMP −1) instead of a viscous 2ζω

    Source of the rules of the table: bulk data entry TABDMP1 of Nastran.
    """

    values: Reals
    freq_hz: Reals | None = None
    by_mode: bool = False
    unit: DampingUnit = "CRIT"
    flat: bool = False
    hysteretic: bool = False

    def ratio(self, freq_hz: ArrayLike) -> Reals:
        """(m,) damping ratios of modes of the given natural frequencies, in their order from the first mode on.

        A line that goes on beyond a table may become negative; that is returned as Nastran takes it.

        Raises
        ------
        FemtuneError : ``damping.too-few-modes`` where a list by mode is too short, ``damping.quality``
        """
        values, _ = self._values(np.asarray(freq_hz, float))
        if self.unit == "Q":
            return np.asarray(0.5 / _checked_quality(values))
        return np.asarray(values if self.unit == "CRIT" else 0.5 * values)

    def slope(self, freq_hz: ArrayLike) -> Reals:
        """(m,) derivatives of the ratios by the natural frequencies, 1/Hz; errors as `ratio`."""
        values, slopes = self._values(np.asarray(freq_hz, float))
        if self.unit == "Q":
            return np.asarray(-0.5 * slopes / _checked_quality(values) ** 2)
        return np.asarray(slopes if self.unit == "CRIT" else 0.5 * slopes)

    def _values(self, freq_hz: Reals) -> tuple[Reals, Reals]:
        """Values in the table's unit, and their slopes."""
        if self.freq_hz is not None and len(self.values) > 1:
            # the two sides of a jump; equal everywhere else
            left, right = self._side(freq_hz, "left"), self._side(freq_hz, "right")
            return 0.5 * (left[0] + right[0]), 0.5 * (left[1] + right[1])
        if self.by_mode and len(self.values) < len(freq_hz):
            raise _too_few(len(self.values), len(freq_hz))
        values = self.values[: len(freq_hz)] if self.by_mode else self.values
        return np.broadcast_to(values, freq_hz.shape), np.zeros(freq_hz.shape)

    def _side(self, freq_hz: Reals, side: Literal["left", "right"]) -> tuple[Reals, Reals]:
        x, y = np.asarray(self.freq_hz), self.values
        i = np.clip(np.searchsorted(x, freq_hz, side), 1, len(x) - 1)
        slope = (y[i] - y[i - 1]) / (x[i] - x[i - 1])
        at = np.clip(freq_hz, x[0], x[-1]) if self.flat else freq_hz
        inside = (at == freq_hz) if self.flat else True
        return y[i - 1] + slope * (at - x[i - 1]), slope * inside


def constant_damping(ratio: float) -> ModalDamping:
    """The same damping ratio for all modes."""
    return ModalDamping(np.array([float(ratio)]))


def damping_by_mode(ratios: Sequence[float]) -> ModalDamping:
    """Damping ratios of the modes in their order, rigid-body modes included (error ``damping.too-few-modes``)."""
    if not len(ratios):
        raise _too_few(0, 1)
    return ModalDamping(np.asarray(ratios, float), by_mode=True)


def damping_table(
    freq_hz: ArrayLike, values: ArrayLike, unit: DampingUnit = "CRIT", flat: bool = False
) -> ModalDamping:
    """Damping over frequency; frequencies rise, or fall throughout, and may stand twice except at the ends.

    Raises
    ------
    FemtuneError : ``damping.table``
    """
    x, y = np.asarray(freq_hz, float), np.asarray(values, float)
    if len(x) > 1 and x[0] > x[-1]:
        x, y = x[::-1], y[::-1]
    problem = _table_problem(x, y, unit)
    if problem:
        raise FemtuneError("damping.table", problem=problem)
    return ModalDamping(y, x, unit=unit, flat=flat)


def _table_problem(x: Reals, y: Reals, unit: DampingUnit) -> str:
    if not len(x) or x.shape != y.shape or not np.isfinite([*x, *y]).all():
        return "contains no pairs of finite numbers"
    steps = np.diff(x)
    if (steps < 0.0).any() or (len(steps) > 1 and ((steps[1:] == 0.0) & (steps[:-1] == 0.0)).any()):
        return "has frequencies that are neither ascending nor descending"
    if len(steps) and 0.0 in (steps[0], steps[-1]):
        return "has a jump at its first or last frequency"
    if unit == "Q" and (y <= 0.0).any():
        return "contains a quality factor Q that is not positive"
    return ""


def as_hysteretic(damping: ModalDamping) -> ModalDamping:
    """The same ratios, as imaginary stiffness of the modes."""
    return replace(damping, hysteretic=True)


def _checked_quality(values: Reals) -> Reals:
    if (values <= 0.0).any():
        raise FemtuneError("damping.quality")
    return values


def _too_few(given: int, modes: int) -> FemtuneError:
    return FemtuneError("damping.too-few-modes", given=given, modes=modes)


# ----------------------------------------------------------------------------------------------------
# A model point without the damping of its elements.


def without_element_damping(point: ModelPoint) -> ModelPoint:
    """The same stiffness and mass, without dashpots and loss factors."""
    configured = point.configured
    modal_only = OverallDamping(mode_ratios=configured.model.structure.damping.mode_ratios)
    structure = replace(configured.model.structure, damping=modal_only)
    kept = tuple(p for p in configured.projected if p.term.matrix in ("stiffness", "mass"))
    bare = replace(configured, model=replace(configured.model, structure=structure), projected=kept)
    return bare.at(point.x)
