"""Are these functions of a structure? Driving points, kinds, units, reciprocity, exchanged channels, levels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Complexes, Flags, Reals
from femtune.errors import FemtuneError, Notice
from femtune.identification.shapes import DrivingPoint, driving_points
from femtune.modal import FrfSet, as_kind
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.frf_set import KINDS, inward_power

POWER_IN = 0.95
"""Part of a driving point's power that must go into the structure, lines weighted by their mobility."""
DEAD = 1e-6
"""A response whose functions are below this part of the median is dead."""
RECIPROCAL = 0.25
"""Relative difference of H_ij and H_ji that is reported."""
COUPLED = 0.02
"""Size of H_ij relative to the driving points, at or below which it is not compared: noise would decide."""
KNOWN_FACTORS = {
    "g instead of m/s²": 9.80665,
    "mm instead of m": 1000.0,
    "lbf instead of N": 4.4482216,
    "in instead of m": 39.3700787,
    "kN instead of N": 1000.0,
}


@dataclass(frozen=True)
class Reciprocity:
    """Difference of two functions that should be one: |H_ij − H_ji| over their mean, norms over the lines.

    `coupling` is this mean over the geometric mean of both driving points: where it is small, as between directions
    that a symmetric structure does not couple, the difference is one of noise.
    """

    first: str
    second: str
    difference: float
    coupling: float


@dataclass(frozen=True, eq=False)
class Levels:
    """Functions at several levels of force against those of the first.

    Parameters
    ----------
    change : (levels, n, u) |H − H_first|/|H_first|, norms over the lines
    significant : (levels, n, u) part of the lines at which the change is beyond three standard deviations; NaN where no
        deviations are known
    linear : whether all changes are noise (or below 5 % where noise is not known)
    """

    change: Reals
    significant: Reals
    linear: bool


def check_frfs(frfs: FrfSet) -> tuple[Notice, ...]:
    """Errors in a set of functions that the functions themselves reveal.

    Returns
    -------
    ``frf.kind-contradicts``, ``frf.driving-point``, ``frf.not-reciprocal``, ``frf.dead``
    """
    return (*_dead(frfs), *_driving(frfs), *_not_reciprocal(frfs))


def dead_responses(frfs: FrfSet) -> Flags:
    """(n,) True where the functions of a response are zero or a million times smaller than those of the others."""
    size = np.sqrt(np.nanmean(np.abs(np.nan_to_num(frfs.values)) ** 2, axis=(1, 2)))
    return np.asarray(size <= DEAD * np.median(size))


def power_in(frfs: FrfSet, point: DrivingPoint, kind: str | None = None) -> float:
    """`femtune.modal.frf_set.inward_power` at a driving point.

    Parameters
    ----------
    kind : read the values as this kind instead of the stated one
    """
    i_omega = 2j * np.pi * frfs.freq_hz
    used = frfs.freq_hz > 0.0
    power = 1 - KINDS.index(kind or frfs.kind)
    mobility = point.sign * frfs.values[point.response, point.reference, used] * i_omega[used] ** power
    return inward_power(mobility[np.isfinite(mobility)])


def reciprocity(frfs: FrfSet) -> tuple[Reciprocity, ...]:
    """Every pair of DOFs that are both responses and references."""
    points = driving_points(frfs)
    pairs = []
    for a, p in enumerate(points):
        for q in points[a + 1 :]:
            one = frfs.values[p.response, q.reference] * p.sign
            other = frfs.values[q.response, p.reference] * q.sign
            known = np.isfinite(one) & np.isfinite(other)
            size = np.linalg.norm(one[known]) + np.linalg.norm(other[known])
            gap = float(2.0 * np.linalg.norm(one[known] - other[known]) / size) if size else float("nan")
            sizes = [np.linalg.norm(np.nan_to_num(frfs.values[r.response, r.reference])[known]) for r in (p, q)]
            coupling = float(0.5 * size / np.sqrt(sizes[0] * sizes[1])) if all(sizes) else float("inf")
            first, second = (str(frfs.references[r.reference]) for r in (p, q))
            pairs.append(Reciprocity(first, second, gap, coupling))
    return tuple(pairs)


def apparent_mass(frfs: FrfSet, to_hz: float) -> Reals:
    """Mass (u,) that each driving point shows below a frequency, of a free structure below its first elastic mode.

    The median of Re(force/acceleration); NaN for references without response or lines.
    """
    acceleration = as_kind(frfs, "accelerance").values
    masses = np.full(len(frfs.references), np.nan)
    lines = (frfs.freq_hz > 0.0) & (frfs.freq_hz <= to_hz)
    for p in driving_points(frfs):
        values = p.sign * acceleration[p.response, p.reference, lines]
        values = values[np.isfinite(values) & (values != 0.0)]
        masses[p.reference] = float(np.median((1.0 / values).real)) if len(values) else np.nan
    return masses


def check_mass(frfs: FrfSet, mass: float, to_hz: float) -> tuple[Notice, ...]:
    """``frf.mass-line`` where driving points show another mass than a scale: a hint of wrong units.

    Parameters
    ----------
    mass : that of the structure, where the driving points act through its centre of mass; else a lower one shows
    """
    masses = []
    for dof, seen in zip(frfs.references, apparent_mass(frfs, to_hz)):
        ratio = mass / seen if seen else np.inf
        if np.isfinite(seen) and not 0.5 < ratio < 5.0 / 3.0:
            near = [w for w, f in KNOWN_FACTORS.items() for r in (f, 1 / f) if abs(np.log(abs(ratio) * r)) < 0.2]
            guess = f"; the cause may be {' or '.join(near)}" if near else ""
            masses.append(Notice("frf.mass-line", to_hz=to_hz, dof=dof, apparent_mass=seen, mass=mass, guess=guess))
    return tuple(masses)


def exchanged(frfs: FrfSet, other: FrfSet, margin: float = 0.1) -> tuple[Notice, ...]:
    """``frf.exchanged`` and ``frf.inverted`` against another measurement or a model of the same structure.

    The other set is converted to the same kind. Responses are matched to its responses by their correlation over all
    references and lines; one that fits another label better by a margin was exchanged.

    Raises
    ------
    FemtuneError : ``identify.lines-differ`` where the sets have other lines or labels
    """
    if frfs.responses != other.responses or frfs.values.shape != other.values.shape:
        raise FemtuneError("identify.lines-differ", values={"one": frfs.values.shape, "other": other.values.shape})
    sets = (frfs, as_kind(other, frfs.kind))
    a, b = (np.nan_to_num(f.values).reshape(len(f.responses), -1) for f in sets)
    inner = _unit(a) @ _unit(b).conj().T
    rows, columns = linear_sum_assignment(-np.abs(inner))
    labels = frfs.responses.labels()
    exchanges = []
    for i, j in zip(rows, columns):
        if i != j and abs(inner[i, j]) > abs(inner[i, i]) + margin:
            exchanges.append(Notice("frf.exchanged", label=labels[i], measured_at=labels[j]))
        if abs(inner[i, j]) > 0.5 and inner[i, j].real < -0.5 * abs(inner[i, j]):
            exchanges.append(Notice("frf.inverted", label=labels[i]))
    return tuple(exchanges)


def compare_levels(levels: Sequence[FrfSet], sd: Sequence[Reals] | None = None) -> Levels:
    """Functions measured at several levels of force: those of a linear structure are the same.

    Parameters
    ----------
    levels : same lines, responses and references; the first is what the others are compared with
    sd : of each, (n, u, k)

    Raises
    ------
    FemtuneError : ``identify.lines-differ``, ``identify.kinds-differ``
    """
    first = levels[0]
    if any(f.values.shape != first.values.shape or not np.array_equal(f.freq_hz, first.freq_hz) for f in levels):
        sizes = {"levels": ", ".join(str(f.values.shape) for f in levels)}
        raise FemtuneError("identify.lines-differ/levels", values=sizes)
    if len(kinds := sorted({f.kind for f in levels})) > 1:
        raise FemtuneError("identify.kinds-differ/levels", values={"kinds": ", ".join(kinds)})
    size = np.linalg.norm(np.nan_to_num(first.values), axis=2)
    size = np.where(size > 0.0, size, np.nan)
    gaps = np.array([f.values - first.values for f in levels])
    change = np.linalg.norm(np.nan_to_num(gaps), axis=3) / size
    if sd is None:
        return Levels(change, np.full(change.shape, np.nan), bool(np.nanmax(change) < 0.05))
    beyond = np.array([np.abs(g) > 3.0 * np.hypot(s, sd[0]) for g, s in zip(gaps, sd)])
    significant = beyond.mean(axis=3)
    # of complex normal errors e^{-9} = 0.0001 lie beyond three √E|error|²
    return Levels(change, significant, bool(significant[1:].max(initial=0.0) < 0.01))


def _unit(rows: Complexes) -> Complexes:
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(rows / np.where(size > 0.0, size, 1.0))


def _dead(frfs: FrfSet) -> Iterator[Notice]:
    dead = np.flatnonzero(dead_responses(frfs))
    if len(dead):
        names = ", ".join(frfs.responses.labels()[i] for i in dead)
        yield Notice("frf.dead", n_dead=len(dead), names=names)


def _driving(frfs: FrfSet) -> Iterator[Notice]:
    for p in driving_points(frfs):
        shares = {kind: power_in(frfs, p, kind) for kind in KINDS}
        expected_share, label = shares[frfs.kind], frfs.references[p.reference]
        if expected_share >= POWER_IN or not np.isfinite(expected_share):
            continue
        better = [kind for kind, share in shares.items() if share >= POWER_IN]
        opposite = KINDS[2 - KINDS.index(frfs.kind)]
        if opposite in better:
            # receptance and accelerance differ in sign, so that a wrong sign looks like the other kind
            yield Notice("frf.kind-contradicts/sign", label=label, better=opposite, kind=frfs.kind)
        elif better:
            yield Notice("frf.kind-contradicts", label=label, better=" or ".join(better), kind=frfs.kind)
        else:
            yield Notice("frf.driving-point", label=label, share=expected_share)


def _not_reciprocal(frfs: FrfSet) -> Iterator[Notice]:
    for pair in reciprocity(frfs):
        if pair.difference > RECIPROCAL and pair.coupling > COUPLED:
            yield Notice("frf.not-reciprocal", first=pair.first, second=pair.second, difference=pair.difference)
