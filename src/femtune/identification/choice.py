"""The modes among the poles: chosen by how often they come back, in a table that can be changed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError
from femtune.identification.pole_table import PoleTable
from femtune.modal.shape_criteria import mac_where_defined
from femtune.testdata.checks import mean_phase_deviation_deg, phase_collinearity

# ----------------------------------------------------------------------------------------------------
# Which poles come back from order to order, and which of them belong together.


@dataclass(frozen=True)
class Limits:
    """When a pole counts as the one of the order before, and which poles can be of a structure.

    Parameters
    ----------
    freq : relative change of frequency
    damping : relative change of the damping ratio; changes below 0.001 of critical count as none
    mac : of the two shapes
    largest_damping : ratio above which a pole is not looked at; those that do not decay never are
    band_hz : frequencies that are looked at
    """

    freq: float = 0.01
    damping: float = 0.1
    mac: float = 0.9
    largest_damping: float = 0.2
    band_hz: tuple[float, float] = (0.0, np.inf)


def possible(table: PoleTable, limits: Limits) -> Flags:
    """(p,) true for poles that decay, with damping and frequency within the limits."""
    freq, damping = table.freq_hz, table.damping_ratio
    low, high = limits.band_hz
    return (damping > 0.0) & (damping <= limits.largest_damping) & (freq >= low) & (freq <= high)


def stable(table: PoleTable, limits: Limits) -> Flags:
    """(p,) true for possible poles that the next lower order of their method has too."""
    is_stable = np.zeros(len(table), bool)
    may = possible(table, limits)
    for now, before in _neighbouring_orders(table):
        here, there = now[may[now]], before[may[before]]
        if len(here) and len(there):
            is_stable[here] = _matches(table, here, there, limits).any(axis=1)
    return is_stable


def _neighbouring_orders(table: PoleTable) -> Iterator[tuple[NDArray, NDArray]]:
    methods = np.array(table.method)
    for method in dict.fromkeys(table.method):
        of_method = np.flatnonzero(methods == method)
        orders = np.unique(table.order[of_method])
        for low, high in pairwise(orders):
            yield of_method[table.order[of_method] == high], of_method[table.order[of_method] == low]


def _matches(table: PoleTable, here: NDArray, there: NDArray, limits: Limits) -> Flags:
    f, g = table.freq_hz[here][:, None], table.freq_hz[there][None, :]
    z, y = table.damping_ratio[here][:, None], table.damping_ratio[there][None, :]
    near = np.abs(f - g) <= limits.freq * np.maximum(f, g)
    near &= np.abs(z - y) <= np.maximum(limits.damping * np.maximum(z, y), 1e-3)
    if len(table.dofs) > 1:
        near &= mac_where_defined(table.shapes[:, here], table.shapes[:, there]) >= limits.mac
    return near


FARTHEST = 0.05
"""Mean distance of two poles in a cluster at most."""


def cluster(table: PoleTable, farthest: float = FARTHEST) -> list[NDArray[np.int64]]:
    """Positions of poles that are the same one in other orders and methods, by ascending frequency.

    The distance of two poles is |λ_i − λ_j| / max(|λ_i|, |λ_j|) + 1 − MAC, clustered by average linkage; with one
    response the MAC has no meaning and is left out.

    Parameters
    ----------
    farthest : mean distance within which clusters are joined

    Source: E. Reynders, J. Houbrechts, G. De Roeck (2012), Fully automated (operational) modal analysis, Mechanical
    Systems and Signal Processing 29.
    """
    if not len(table):
        return []
    order = np.argsort(table.freq_hz, kind="stable")
    apart = np.diff(table.freq_hz[order]) > farthest * table.freq_hz[order][1:]
    chains = np.split(order, np.flatnonzero(apart) + 1)
    groups = [group for chain in chains for group in _joined(table, chain, farthest)]
    return sorted(groups, key=lambda group: float(np.median(table.freq_hz[group])))


def _joined(table: PoleTable, chain: NDArray, farthest: float) -> list[NDArray[np.int64]]:
    if len(chain) == 1:
        return [chain]
    poles = table.poles[chain]
    size = np.maximum(np.abs(poles)[:, None], np.abs(poles)[None, :])
    distance = np.abs(poles[:, None] - poles[None, :]) / size
    if len(table.dofs) > 1:
        distance += 1.0 - np.nan_to_num(mac_where_defined(table.shapes[:, chain], table.shapes[:, chain]))
    distance = np.clip(0.5 * (distance + distance.T), 0.0, None)
    np.fill_diagonal(distance, 0.0)
    return [chain[group] for group in joined_by_average(distance, farthest)]


def joined_by_average(distance: Reals, farthest: float) -> list[NDArray[np.int64]]:
    """Groups of positions whose mean distance (n, n), symmetric with n ≥ 2, is within a limit."""
    labels = fcluster(linkage(squareform(distance, checks=False), "average"), farthest, "distance")
    return [np.flatnonzero(labels == label) for label in np.unique(labels)]


CHOSEN_BY_USER = "chosen by the user"
"""Reason of a candidate that the user takes."""
DROPPED_BY_USER = "dropped by the user"
"""Reason of a candidate that the user rejects."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One cluster of stable poles.

    Parameters
    ----------
    freq_hz, damping_ratio : medians of the cluster
    freq_scatter_hz, damping_scatter : standard deviations over orders and methods, a measure of how stable the cluster
        is and are no error bars
    share : of each method, the part of its orders that has the pole
    collinearity, phase_deviation_deg : of the shape; 1 and 0 for a real mode
    members : positions of its poles in the table
    at : position of the pole nearest to the medians
    chosen : whether it is taken as a mode
    reason : why, in words
    name : of the mode, "" for its number
    left : whether the fit moved its pole to another place
    divided : whether it is one of two modes whose poles are one cluster, with a shape that is a mixture of theirs
    """

    freq_hz: float
    damping_ratio: float
    freq_scatter_hz: float
    damping_scatter: float
    share: dict[str, float]
    collinearity: float
    phase_deviation_deg: float
    members: NDArray[np.int64]
    at: int
    chosen: bool
    reason: str
    name: str = ""
    left: bool = False
    divided: bool = False


@dataclass(frozen=True)
class PickedPole:
    """A pole that a person picked in the stabilisation diagram.

    Parameters
    ----------
    method, order : where it is
    freq_hz, damping_ratio : of the pole itself
    name : of the mode, "" for its number
    fit_only : the fit of functions starts with it too, but where it leaves its cluster it is no mode
    """

    method: str
    order: int
    freq_hz: float
    damping_ratio: float
    name: str = ""
    fit_only: bool = False


@dataclass(frozen=True)
class Rule:
    """What a cluster needs to be a mode.

    Parameters
    ----------
    share : smallest part of a method's orders that have the pole, in the method that has it most, where another has it
        in half of that
    alone : share that is enough where one method alone has it
    collinearity : smallest phase collinearity of the shape
    same : of two clusters whose frequencies differ by less than this fraction, and whose shapes have a MAC above 0.8 or
        which no order of any method has side by side, one is a mode, that of the larger share
    """

    share: float = 0.3
    alone: float = 0.5
    collinearity: float = 0.0
    same: float = 0.003


def choose(table: PoleTable, limits: Limits = Limits(), rule: Rule = Rule()) -> tuple[Candidate, ...]:
    """Clusters of the stable poles, by ascending frequency, each with the choice and its reason.

    Parameters
    ----------
    table : poles of several orders, of one or several methods
    """
    firm = np.flatnonzero(stable(table, limits))
    groups = [firm[group] for group in cluster(table.select(firm))]
    orders = _orders(table)
    candidates = [one for group in groups for one in _divided(_candidate(table, group, orders, rule), table, rule)]
    candidates.sort(key=lambda c: c.freq_hz)
    return tuple(_without_duplicates(candidates, table, rule))


def _divided(one: Candidate, table: PoleTable, rule: Rule) -> list[Candidate]:
    """The parts of a cluster of one response that are modes of their own: no shapes keep close modes apart.

    Many orders have both of two modes, each always on its side; the cluster is divided at ever smaller distances until
    each of two parts is a mode by the rule, and as many orders have both.
    """
    if len(table.dofs) > 1 or not one.chosen:
        return [one]
    orders, members = _orders(table), table.select(one.members)
    farthest = 0.5 * FARTHEST
    while farthest > rule.same:
        parts = [_candidate(table, one.members[group], orders, rule) for group in cluster(members, farthest)]
        modes = [part for part in parts if part.chosen and _agreed(part, rule)]
        if len(modes) > 1 and all(_share_together(a, b, table) >= rule.share for a, b in pairwise(modes)):
            return parts
        farthest *= 0.5
    return [one]


def _agreed(one: Candidate, rule: Rule) -> bool:
    """Whether two methods have the pole, where there are two: one alone divides poles by noise at high orders."""
    return sum(share >= 0.5 * rule.share for share in one.share.values()) >= min(2, len(one.share))


def _share_together(a: Candidate, b: Candidate, table: PoleTable) -> float:
    """Part of the orders of a method that have poles of both clusters, of the method that has most."""
    both = set.intersection(*({(table.method[i], int(table.order[i])) for i in c.members} for c in (a, b)))
    return max(sum(name == method for name, _ in both) / count for method, count in _orders(table).items())


_UPPER = 1.0 / 3.0
"""Part of the orders, the largest ones, in which clusters are looked for that come back there."""
_COMES_BACK = 0.5
"""Part of these orders of a method that have the pole."""


def come_back(candidates: Sequence[Candidate], table: PoleTable) -> tuple[Candidate, ...]:
    """Clusters that half of the largest orders of a method have, whatever share of all orders that is.

    Low orders cannot have all modes. Those that come back in the largest orders and are not chosen show that the orders
    end too early.
    """
    methods = np.array(table.method)
    upper = dict[str, NDArray[np.int64]]()
    for name in dict.fromkeys(table.method):
        orders = np.unique(table.order[methods == name])
        upper[name] = orders[orders >= orders[-1] - _UPPER * (orders[-1] - orders[0])]

    def comes_back(one: Candidate) -> bool:
        mine = methods[one.members]
        return any(
            np.isin(orders, table.order[one.members][mine == name]).mean() >= _COMES_BACK
            for name, orders in upper.items()
        )

    return tuple(c for c in candidates if (c.chosen or c.reason.startswith("stable in")) and comes_back(c))


def change_choice(
    candidates: Sequence[Candidate], take: Sequence[float] = (), drop: Sequence[float] = (), within: float = 0.01
) -> tuple[Candidate, ...]:
    """The table with other choices: candidates nearest to frequencies in Hz are taken or dropped.

    Raises
    ------
    FemtuneError : ``identify.no-candidate`` where none lies within that relative distance of a frequency
    """
    changed = list(candidates)
    for freq, chosen in (*((f, True) for f in take), *((f, False) for f in drop)):
        i = _nearest(changed, freq, within)
        reason = CHOSEN_BY_USER if chosen else DROPPED_BY_USER
        changed[i] = replace(changed[i], chosen=chosen, reason=reason)
    return tuple(changed)


SAME_POLE = 1e-5
"""Distance |λ − λ'|/|λ| up to which a pole is the one that was picked: pages have seven digits, and numerical libraries
differ by less. Another record, band or method moves poles by more."""


def pick_poles(
    candidates: Sequence[Candidate], table: PoleTable, picked: Sequence[PickedPole]
) -> tuple[Candidate, ...]:
    """The table with the picked poles as the modes, whatever the rule says; all other candidates are dropped.

    A cluster is represented by the pole that was picked in it. A pole that is in no cluster becomes one, and so does
    the second one of a cluster.

    Raises
    ------
    FemtuneError : ``identify.choices/no-pole`` where the method has no such pole at this order
    """
    changed = [replace(c, chosen=False, reason=DROPPED_BY_USER if c.chosen else c.reason) for c in candidates]
    orders, taken = _orders(table), set[int]()
    for one in picked:
        at = _pole_at(table, one)
        if at in taken:
            raise FemtuneError("identify.choices/twice", values=_values(one))
        taken.add(at)
        i = next((i for i, c in enumerate(changed) if at in c.members and not c.chosen), len(changed))
        if i == len(changed):
            changed.append(_candidate(table, np.array([at]), orders, Rule()))
        reason = changed[i].reason if one.fit_only else CHOSEN_BY_USER
        changed[i] = replace(changed[i], at=at, chosen=True, reason=reason, name=one.name)
    return tuple(sorted(changed, key=lambda c: c.freq_hz))


def poles_of_order(
    candidates: Sequence[Candidate], table: PoleTable, method: str, order: int, limits: Limits
) -> tuple[Candidate, ...]:
    """The table with all possible poles of one order of a method as the modes, whatever other orders have."""
    rows = possible(table, limits) & (np.array(table.method) == method) & (table.order == order)
    picked = [
        PickedPole(method, order, float(freq), float(ratio), fit_only=True)
        for freq, ratio in zip(table.freq_hz[rows], table.damping_ratio[rows])
    ]
    reason = f"pole of the order {order}"
    return tuple(replace(c, reason=reason) if c.chosen else c for c in pick_poles(candidates, table, picked))


def _values(one: PickedPole) -> dict[str, object]:
    return {"method": one.method, "order": one.order, "freq_hz": one.freq_hz, "damping_ratio": one.damping_ratio}


def _pole_at(table: PoleTable, one: PickedPole) -> int:
    """Position of the pole of a method and order that is the picked one."""
    omega = 2.0 * np.pi * one.freq_hz
    pole = omega * (-one.damping_ratio + 1j * np.sqrt(max(0.0, 1.0 - one.damping_ratio**2)))
    rows = np.flatnonzero((np.array(table.method) == one.method) & (table.order == one.order))
    away = np.abs(table.poles[rows] - pole) / omega
    if not len(rows) or away.min() > SAME_POLE:
        raise FemtuneError("identify.choices/no-pole", values=_values(one))
    return int(rows[away.argmin()])


def has_candidate(candidates: Sequence[Candidate], freq: float, within: float = 0.01) -> bool:
    """True where a candidate lies within that relative distance of a frequency in Hz."""
    return any(abs(c.freq_hz - freq) <= within * freq for c in candidates)


def chosen_poles(candidates: Sequence[Candidate], table: PoleTable) -> PoleTable:
    """The representative poles of the chosen candidates."""
    return table.select([c.at for c in candidates if c.chosen])


def _without_duplicates(found: Sequence[Candidate], table: PoleTable, rule: Rule) -> list[Candidate]:
    """Clusters that were split by bias or variance of a method are joined to one mode.

    Those of two close modes that a method tells apart come before a mixture of both that another method finds.
    """
    kept: list[Candidate] = []
    result, chosen = list(found), [c for c in found if c.chosen]
    mixture = [_is_mixture(c, [d for d in chosen if d is not c and _near(c, d, rule)], table) for c in found]
    for i in sorted(range(len(found)), key=lambda i: (mixture[i], -len(found[i].members))):
        twin = next((c for c in kept if _near(c, found[i], rule) and _same(c, found[i], table)), None)
        if found[i].chosen and twin is not None:
            result[i] = replace(found[i], chosen=False, reason=f"same mode as at {twin.freq_hz:.4g} Hz")
        elif found[i].chosen:
            kept.append(found[i])
    return result


def _is_mixture(c: Candidate, near: Sequence[Candidate], table: PoleTable) -> bool:
    """Whether two of those near it are different modes, which no order has beside it."""
    other = [d for d in near if not _found_together(c, d, table)]
    return any(_found_together(a, b, table) and not _same(a, b, table) for a, b in combinations(other, 2))


def _near(a: Candidate, b: Candidate, rule: Rule) -> bool:
    return abs(a.freq_hz - b.freq_hz) <= rule.same * max(a.freq_hz, b.freq_hz)


def _same(a: Candidate, b: Candidate, table: PoleTable) -> bool:
    """Whether two clusters of nearly the same frequency are one mode."""
    if len(table.dofs) == 1 or not _found_together(a, b, table):
        return True
    return bool(mac_where_defined(table.shapes[:, [a.at]], table.shapes[:, [b.at]])[0, 0] > 0.8)


def _found_together(a: Candidate, b: Candidate, table: PoleTable) -> bool:
    """Whether a method has both at one of its orders: two modes do not exclude each other."""
    orders = [{(table.method[i], int(table.order[i])) for i in c.members} for c in (a, b)]
    return bool(orders[0] & orders[1])


def _nearest(candidates: Sequence[Candidate], freq: float, within: float) -> int:
    distances = [abs(c.freq_hz - freq) for c in candidates]
    if not distances or min(distances) > within * freq:
        near = f"{candidates[int(np.argmin(distances))].freq_hz:.4g} Hz" if distances else "there are none"
        raise FemtuneError("identify.no-candidate", values={"nearest": near}, freq=freq)
    return int(np.argmin(distances))


def _orders(table: PoleTable) -> dict[str, int]:
    """How many orders each method was tried at: from where it first has stable poles would flatter it."""
    methods = np.array(table.method)
    return {name: len(np.unique(table.order[methods == name])) for name in dict.fromkeys(table.method)}


def _candidate(table: PoleTable, group: NDArray, orders: dict[str, int], rule: Rule) -> Candidate:
    freq, damping = table.freq_hz[group], table.damping_ratio[group]
    middle = float(np.median(freq)), float(np.median(damping))
    spread = float(freq.std()), float(damping.std())
    away = np.abs(freq - middle[0]) / max(spread[0], 1e-12 * middle[0]) + np.abs(damping - middle[1]) / max(
        spread[1], 1e-12
    )
    at = int(group[np.argmin(away)])
    methods = np.array(table.method)[group]
    share = {name: len(np.unique(table.order[group][methods == name])) / count for name, count in orders.items()}
    collinearity = phase_collinearity(table.shapes[:, at])
    chosen, reason = _verdict(share, collinearity, rule)
    deviation = mean_phase_deviation_deg(table.shapes[:, at])
    return Candidate(*middle, *spread, share, collinearity, deviation, group, at, chosen, reason)


def _verdict(share: dict[str, float], collinearity: float, rule: Rule) -> tuple[bool, str]:
    best = max(share.values())
    several = sum(value >= 0.5 * rule.share for value in share.values())
    if best < rule.share:
        return False, f"stable in only {best:.0%} of the orders"
    if several < 2 and best < rule.alone:
        return False, f"stable in {best:.0%} of the orders of one method only"
    if collinearity < rule.collinearity:
        return False, f"its shape is complex (phase collinearity {collinearity:.2f})"
    return True, f"stable in {best:.0%} of the orders"
