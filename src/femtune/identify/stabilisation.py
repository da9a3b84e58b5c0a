"""Which poles come back from order to order, and which of them belong together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from femtune.identify.pole_table import PoleTable
from femtune.modal.mac import mac_where_defined

Reals = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Limits:
    """When a pole counts as the one of the order before, and which poles can be of a structure.

    Parameters
    ----------
    freq : relative change of frequency
    damping : relative change of the damping ratio; changes below .001 of critical count as none
    mac : of the two shapes
    largest_damping : ratio above which a pole is not looked at; those that do not decay never are
    band_hz : frequencies that are looked at
    """

    freq: float = 0.01
    damping: float = 0.1
    mac: float = 0.9
    largest_damping: float = 0.2
    band_hz: tuple[float, float] = (0.0, np.inf)


def possible(table: PoleTable, limits: Limits) -> Bools:
    """(p,) true for poles that decay, with damping and frequency within the limits."""
    freq, damping = table.freq_hz, table.damping_ratio
    low, high = limits.band_hz
    return (damping > 0.0) & (damping <= limits.largest_damping) & (freq >= low) & (freq <= high)


def stable(table: PoleTable, limits: Limits) -> Bools:
    """(p,) true for possible poles that the next lower order of their method has too."""
    found = np.zeros(len(table), bool)
    may = possible(table, limits)
    for now, before in _neighbouring_orders(table):
        here, there = now[may[now]], before[may[before]]
        if len(here) and len(there):
            found[here] = _matches(table, here, there, limits).any(axis=1)
    return found


def _neighbouring_orders(table: PoleTable) -> Iterator[tuple[NDArray, NDArray]]:
    methods = np.array(table.method)
    for method in dict.fromkeys(table.method):
        own = np.flatnonzero(methods == method)
        orders = np.unique(table.order[own])
        for low, high in pairwise(orders):
            yield own[table.order[own] == high], own[table.order[own] == low]


def _matches(table: PoleTable, here: NDArray, there: NDArray, limits: Limits) -> Bools:
    f, g = table.freq_hz[here][:, None], table.freq_hz[there][None, :]
    z, y = table.damping_ratio[here][:, None], table.damping_ratio[there][None, :]
    near = np.abs(f - g) <= limits.freq * np.maximum(f, g)
    near &= np.abs(z - y) <= np.maximum(limits.damping * np.maximum(z, y), 1e-3)
    if len(table.dofs) > 1:
        near &= mac_where_defined(table.shapes[:, here], table.shapes[:, there]) >= limits.mac
    return near


def cluster(table: PoleTable, farthest: float = 0.05) -> list[NDArray[np.int64]]:
    """Positions of poles that are the same one in other orders and methods, by ascending frequency.

    The distance of two poles is |λ_i − λ_j| / max(|λ_i|, |λ_j|) + 1 − MAC, clustered by average linkage; with one
    response the MAC says nothing and is left out.

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
