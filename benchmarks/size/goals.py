"""The goals, with what was measured beside each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from checks import DERIVATIVE
from summary import CHANGED, MODES, Summary, ratio


@dataclass(frozen=True)
class Goal:
    """One line of the table; `met` is None where it was not measured."""

    what: str
    wanted: str
    measured: str
    met: bool | None

    @property
    def verdict(self) -> str:
        """In a word."""
        return "not measured" if self.met is None else "met" if self.met else "not met"


def goals(ways: Mapping[str, Summary]) -> list[Goal]:
    """Of one case at one size."""
    own, peer = ways.get("femtune"), ways.get("eigsh-pardiso")
    if own is None or not own.good:
        return []
    pairs = ((MODES, "", 2.0, 2.5), ("re-solve after a change of all parameters", CHANGED, 3.0, 5.0))
    faster = [_faster(name, own, peer, suffix, bounds) for name, suffix, *bounds in pairs]
    return [*faster, _derivatives(own), _accuracy(own), _memory(own)]


def _faster(name: str, own: Summary, peer: Summary | None, suffix: str, bounds: list[float]) -> Goal:
    """By the clock; processor seconds beside it, which a busy machine disturbs less."""
    found, of_processor = (
        ratio(peer.modes(suffix, what) if peer else None, own.modes(suffix, what))
        for what in ("seconds", "cpu_seconds")
    )
    least, aim = bounds
    measured = f"{times(found)} (by processor time {times(of_processor)})"
    met = None if found is None else found >= least
    return Goal(f"{name}, against eigsh on PARDISO", f"≥ {least:g} × (aim {aim:g})", measured, met)


def times(value: float | None) -> str:
    """A ratio in words."""
    return "–" if value is None else f"{value:.2f} ×"


def _derivatives(own: Summary) -> Goal:
    took, modes = own.seconds("derivatives"), own.modes()
    part = None if took is None or not modes else took / modes
    measured = "–" if part is None else f"{part:.2f} of it"
    met = None if part is None else part <= 1.0
    return Goal("all derivatives of values, and of vectors at the sensors", "within the modes' own time", measured, met)


def _accuracy(own: Summary) -> Goal:
    values, shapes, single = (
        max(row["derivative_error"].get(name, 0.0) for row in own.good)
        for name in ("eigenvalues", "shapes", "single_shapes")
    )
    measured = f"{values:.0e} of values, {shapes:.0e} of vectors; {single:.0e} relative to each parameter's own"
    what = "derivatives against Nelson's method, relative to the mode's largest"
    return Goal(what, f"≤ {DERIVATIVE:g}", measured, max(values, shapes) <= DERIVATIVE)


def _memory(own: Summary) -> Goal:
    peak = own.peak_gib()
    assert peak is not None
    return Goal("peak memory", "< 6 GiB", f"{peak:.2f} GiB", peak < 6.0)
