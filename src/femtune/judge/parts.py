"""Which part of the residuals is larger, or smaller, than noise of the stated size?

A part is a set S of rows: all of them, a kind, a mode, a sensor, a configuration, the prior of a parameter. With P of
the record and A = S P Sᵀ the sum of squares q = |S P r|² is a weighted sum of chi-squares with mean ν₁ = tr A and
variance 2ν₂, ν₂ = tr A²; q ν₁/ν₂ is compared with a chi-square of ν₁²/ν₂ degrees of freedom. That is exact where A is a
projection: for all rows, and for single values.

Parts of a family are corrected for their number by Holm's rule, and so are the families among each other.

Source: F. E. Satterthwaite, Biometrics Bulletin 2, 1946, 110-114; S. Holm, Scandinavian Journal of Statistics 6, 1979,
65-70; bounds: D. J. Bartholomew, Journal of the Royal Statistical Society B 23, 1961, 239-281.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, gammainc, gammaincc

from femtune.judge.kinds import PartFamily
from femtune.judge.whitened import PRIOR, Whitened

_LEAST_DEGREES = 0.05
"""Degrees of freedom below which a part is not tested: the parameters fit it, and what is left is the curvature of the
model, which the linear problem neglects."""
_LEAST_OF_PRIOR = 1e-6
"""The same of a prior, whose rows are linear: a tight one leaves little, and what is left beyond noise is all the more
certain."""


@dataclass(frozen=True)
class ResidualPart:
    """A part of the residuals and its test.

    Parameters
    ----------
    family : what the part is one of
    kind, configuration, mode, sensor : what its rows have in common; "" where they differ. The mode of a prior is the
        name of its parameter
    values : number of rows
    chi_square, degrees : q and tr A
    p_large, p_small : chance of a q as large or larger, and as small or smaller, where the model is right and the
        standard deviations are those of the data. `p_small` is NaN where it has no meaning
    p_family_wise : `p_large` corrected for the number of parts and families
    """

    family: PartFamily
    kind: str
    configuration: str
    mode: str
    sensor: str
    values: int
    chi_square: float
    degrees: float
    p_large: float
    p_small: float
    p_family_wise: float = 1.0


def parts(
    record: Whitened, side_constraint: bool = False, estimated: Collection[str] = (),
    of_macs: tuple[ResidualPart, ...] = (),
) -> tuple[ResidualPart, ...]:  # fmt: skip
    """All parts with their tests, family by family.

    Parameters
    ----------
    side_constraint : whether a side constraint that is no information keeps the parameters from the least squares
    estimated : kinds whose standard deviations follow from these residuals: their size as a whole tells nothing
    of_macs : MACs beside the noise of the shapes, a family of its own

    Examples
    --------
    Eight frequencies with errors of the stated size, but for the last:

    >>> n, r = 8, np.array([1.0, -0.5, 0.8, -1.2, 0.3, -0.9, 0.6, 7.0])
    >>> modes = tuple(f"{i + 1}" for i in range(n))
    >>> rows = Whitened(r, np.zeros((n, 0)), (), np.zeros((n, 0)), ("frequency",) * n, ("test",) * n, modes, ("",) * n,
    ...                 ("data",) * n, np.ones(n), np.zeros((n, 0)), frozenset({"frequency"}))
    >>> min(parts(rows), key=lambda p: p.p_family_wise).mode
    '8'
    """
    every = record.of_all_parameters
    families = {f: tuple(members) for f, members in _families(every, estimated)}
    held = _held_by_side_constraint(every) if side_constraint else _held(record)
    tested = {key: tuple(_tested(every, key[0], *m) for m in members) for key, members in families.items()}
    kept = {key: tuple(p for p in members if p is not None) for key, members in tested.items()}
    if of_macs:
        kept["modes", of_macs[0].kind] = of_macs
    if held is not None:
        kept[held.family, ""] = (held,)
    return tuple(p for members in family_wise({k: m for k, m in kept.items() if m}) for p in members)


_Key = tuple[PartFamily, str]
_Member = tuple[NDArray[np.int64], dict[str, str]]


def _families(record: Whitened, estimated: Collection[str]) -> Iterator[tuple[_Key, list[_Member]]]:
    """Rows and labels of the parts of each family; families of one part repeat another and are left out."""
    n = len(record.r)
    kinds = [(record.of_kind(k), {"kind": k}) for k in dict.fromkeys(record.kinds) if k != PRIOR]
    several = len(kinds) != 1 or PRIOR in record.kinds
    whole: list[_Member] = [(np.arange(n), {})] if n and several and not estimated else []
    yield ("kinds", ""), [*whole, *((rows, k) for rows, k in kinds if k["kind"] not in estimated)]
    for kind in (k["kind"] for _, k in kinds):
        of_kind = record.of_kind(kind)
        places = [(record.configurations[i], record.modes[i]) for i in of_kind]
        members = [
            (of_kind[[p == place for p in places]], {"kind": kind, "configuration": place[0], "mode": place[1]})
            for place in dict.fromkeys(places)
        ]
        if len(members) > 1:
            yield ("modes" if kind in record.of_modes else "comparisons", kind), members
    yield from _of_labels("sensors", "sensor", record.sensors)
    yield from _of_labels("configurations", "configuration", record.configurations)
    priors = record.of_kind(PRIOR)
    if len(priors):
        yield ("priors", ""), [(priors[[i]], {"kind": PRIOR, "mode": record.modes[at]}) for i, at in enumerate(priors)]


def only_prior_contradicts(record: Whitened, level: float) -> bool:
    """Whether the data alone are noise, and no longer with the prior: their difference is a chi-square of its own."""
    every = record.of_all_parameters
    data = every.without_kinds({PRIOR: "a prior"})
    (degrees, q), (of_data, q_data) = (
        (r.degrees(np.arange(len(r.r)))[0], float(r.left @ r.left)) for r in (every, data)
    )
    added = degrees - of_data
    if added <= _LEAST_OF_PRIOR:
        return False
    alone = float(chdtrc(of_data, q_data)) if of_data > _LEAST_DEGREES else 1.0
    return bool(alone >= level > chdtrc(added, max(q - q_data, 0.0)))


def _of_labels(family: PartFamily, word: str, labels: Sequence[str]) -> Iterator[tuple[_Key, list[_Member]]]:
    names, own = [label for label in dict.fromkeys(labels) if label], np.asarray(labels)
    if len(names) > 1:
        yield (family, ""), [(np.flatnonzero(own == name), {word: name}) for name in names]


def _tested(
    record: Whitened, family: PartFamily, rows: NDArray[np.int64], labels: Mapping[str, str]
) -> ResidualPart | None:
    """The test of some rows; None where the parameters leave nothing of them."""
    first, second = record.degrees(rows)
    if first <= (_LEAST_OF_PRIOR if family == "priors" else _LEAST_DEGREES):
        return None
    q, degrees = float(np.sum(record.left[rows] ** 2)), first**2 / second
    scaled = q * first / second
    large, small = gammaincc(0.5 * degrees, 0.5 * scaled), gammainc(0.5 * degrees, 0.5 * scaled)
    kind, configuration, mode, sensor = (labels.get(w, "") for w in ("kind", "configuration", "mode", "sensor"))
    return ResidualPart(
        family=family,
        kind=kind,
        configuration=configuration,
        mode=mode,
        sensor=sensor,
        values=len(rows),
        chi_square=q,
        degrees=first,
        p_large=float(large),
        p_small=float(small),
    )


def _held(record: Whitened) -> ResidualPart | None:
    """What parameters at a bound would remove beyond it.

    Where the true values are within the bounds this is a chi-square with as many degrees of freedom as directions are
    held, or smaller.
    """
    columns = record.across(record.bounded)
    size = np.linalg.norm(record.bounded, axis=0)
    felt = np.linalg.norm(columns, axis=0) > 1e-6 * size
    if not record.optimum or not felt.any():
        return None
    U, s, _ = np.linalg.svd(columns[:, felt] / size[felt], full_matrices=False)
    U = U[:, s > 1e-6 * s[0]]
    return _of_held("bounds", float(np.sum((U.T @ record.r) ** 2)), U.shape[1])


def _held_by_side_constraint(record: Whitened) -> ResidualPart | None:
    """What the parameters would remove without the side constraint: the data refute the values that it holds."""
    U = record.range
    if not record.optimum or not U.shape[1]:
        return None
    return _of_held("side constraint", float(np.sum((U.T @ record.r) ** 2)), U.shape[1])


def _of_held(family: PartFamily, q: float, degrees: int) -> ResidualPart:
    return ResidualPart(
        family=family,
        kind="",
        configuration="",
        mode="",
        sensor="",
        values=degrees,
        chi_square=q,
        degrees=degrees,
        p_large=float(chdtrc(degrees, q)),
        p_small=float("nan"),
    )


def holm(p: Sequence[float]) -> list[float]:
    """PartFamily-wise p-values of several tests, by Holm's rule.

    Examples
    --------
    >>> holm([0.04, 0.01, 0.5])
    [0.08, 0.03, 0.5]
    """
    order, largest, out = np.argsort(p, kind="stable"), 0.0, [0.0] * len(p)
    for done, i in enumerate(order):
        largest = max(largest, min(1.0, (len(p) - done) * float(p[i])))
        out[int(i)] = largest
    return out


def family_wise(families: Mapping[_Key, tuple[ResidualPart, ...]], further: int = 0) -> list[tuple[ResidualPart, ...]]:
    """The parts with their p-values corrected within and between families.

    The least p-value of each family is corrected by Holm's rule among the families; those of its other parts by the
    number of families, so that the chance of any false finding is below the level.

    Parameters
    ----------
    further : families of other tests that the same level is for
    """
    within = {key: holm([p.p_large for p in members]) for key, members in families.items()}
    least = [min(p) for p in within.values()]
    between = holm([*least, *[1.0] * further])
    out = []
    for (key, members), of_family, best in zip(families.items(), between, least):
        adjusted = [
            of_family if p == best else min(1.0, max(of_family, p * (len(least) + further))) for p in within[key]
        ]
        out.append(tuple(replace(part, p_family_wise=p) for part, p in zip(members, adjusted)))
    return out
