"""Several estimates of the same modes, by several methods from several fragments of a record, made into one.

As the benchmark building was identified: every method on every fragment, then means and standard deviations (its
Table 3). The errors of fragments are independent, those of methods on one fragment are not; so the deviation of the
mean comes from the fragments, and what methods differ by beyond that shows their bias. Fewer than ten fragments tell
their scatter badly: then the deviations count that a method states for each of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.identification.choice import joined_by_average
from femtune.modal import ModeSet
from femtune.modal.shape_criteria import mac


@dataclass(frozen=True, eq=False)
class Estimate:
    """Modes of one method from one fragment, with real shapes at the same DOFs as all others.

    Parameters
    ----------
    weight : of the fragment in means: its length, if fragments differ in it
    """

    method: str
    fragment: int
    modes: ModeSet
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class CombinedModes:
    """Means over estimates, weighted by the lengths of their fragments.

    Parameters
    ----------
    modes : (m) means, shapes of unit norm; `freq_sd_hz`, `damping_sd` and `shapes_sd` are of the means
    scatter_hz, shape_scatter : (m,) and (n, m) standard deviations of the single estimates
    found : (m,) number of estimates that each mode was found in
    by_method : mean frequencies (m,) of each method; NaN where it never found the mode
    dropped : frequency and number of estimates of what too few of them found
    """

    modes: ModeSet
    scatter_hz: Reals
    shape_scatter: Reals
    found: NDArray[np.int64]
    by_method: dict[str, Reals]
    dropped: tuple[tuple[float, int], ...]


def combine(
    estimates: Sequence[Estimate], gap: float = 0.02, least_mac: float = 0.8, share: float = 0.5
) -> CombinedModes:
    """Group the modes of all estimates and average each group.

    Parameters
    ----------
    gap : relative difference of frequency up to which two estimates may be one mode
    least_mac : and their MAC at least
    share : part of the estimates that has to find a mode

    Raises
    ------
    FemtuneError : ``identify.no-modes`` where no mode is found often enough
    """
    pool = _ModePool.of(estimates)
    groups = pool.groups(gap, least_mac)
    wanted = share * len(estimates)
    kept = sorted((g for g in groups if len(g) >= wanted), key=pool.mean_hz)
    if not kept:
        raise FemtuneError(
            "identify.no-modes",
            values={"most estimates of one mode": max(map(len, groups), default=0)},
            share=share,
            n_estimates=len(estimates),
        )
    dropped = tuple((pool.mean_hz(g), len(g)) for g in groups if len(g) < wanted)
    return pool.combined(kept, tuple(sorted(dropped)))


@dataclass(frozen=True, eq=False)
class _ModePool:
    """All modes of all estimates in one row; `source` is the estimate that each is from.

    Standard deviations are those that the methods state, NaN without them.
    """

    estimates: Sequence[Estimate]
    freq_hz: Reals
    damping: Reals
    shapes: Reals
    source: NDArray[np.int64]
    freq_sd_hz: Reals
    damping_sd: Reals
    shapes_sd: Reals

    @property
    def weights(self) -> Reals:
        """Of all modes, those of their fragments."""
        return np.array([one.weight for one in self.estimates])[self.source]

    @staticmethod
    def of(estimates: Sequence[Estimate]) -> _ModePool:
        sets = [e.modes for e in estimates]
        unknown = (np.full(len(s), np.nan) if s.damping_ratio is None else s.damping_ratio for s in sets)
        shapes = np.hstack([s.shapes for s in sets])
        source = np.repeat(np.arange(len(sets)), [len(s) for s in sets])
        size = np.linalg.norm(shapes, axis=0)
        freq_sd = [_or_nan(s.freq_sd_hz, s.freq_hz) for s in sets]
        damping_sd = [_or_nan(s.damping_sd, s.freq_hz) for s in sets]
        shapes_sd = [_or_nan(s.shapes_sd, s.shapes) for s in sets]
        return _ModePool(
            estimates, np.concatenate([s.freq_hz for s in sets]), np.concatenate([*unknown]), shapes / size, source,
            np.concatenate(freq_sd), np.concatenate(damping_sd), np.hstack(shapes_sd) / size,
        )  # fmt: skip

    def mean_hz(self, group: NDArray[np.int64]) -> float:
        return _mean(self.freq_hz[group], self.weights[group])

    def groups(self, gap: float, least_mac: float) -> list[NDArray[np.int64]]:
        """Positions of the members of each group, at most one of each estimate: that nearest to the middle."""
        if len(self.freq_hz) < 2:
            return [np.arange(len(self.freq_hz))] if len(self.freq_hz) else []
        apart = np.abs(self.freq_hz[:, None] - self.freq_hz) / np.minimum(self.freq_hz[:, None], self.freq_hz) / gap
        unlike = (1.0 - mac(self.shapes, self.shapes)) / (1.0 - least_mac)
        distance = np.maximum(apart, unlike)
        np.fill_diagonal(distance, 0.0)
        return [self._one_each(group) for group in joined_by_average(distance, 1.0)]

    def _one_each(self, group: NDArray[np.int64]) -> NDArray[np.int64]:
        away = np.abs(self.freq_hz[group] - np.median(self.freq_hz[group]))
        by_distance = group[np.argsort(away, kind="stable")]
        _, first = np.unique(self.source[by_distance], return_index=True)
        return np.sort(by_distance[first])

    def combined(self, groups: list[NDArray[np.int64]], dropped: tuple[tuple[float, int], ...]) -> CombinedModes:
        aligned = [_aligned(self.shapes[:, g]) for g in groups]
        shapes = np.stack([np.average(a, axis=1, weights=self.weights[g]) for a, g in zip(aligned, groups)], axis=1)
        length = np.linalg.norm(shapes, axis=0)
        sd = np.stack([self._sd_of_mean(a, g, self.shapes_sd[:, g]) for a, g in zip(aligned, groups)], axis=1)
        modes = ModeSet(
            np.array([self.mean_hz(g) for g in groups]),
            shapes / length,
            self.estimates[0].modes.dofs,
            damping_ratio=np.array([_mean(self.damping[g], self.weights[g]) for g in groups]),
            normalisation="unit-norm",
            freq_sd_hz=np.array([self._sd_of_mean(self.freq_hz[g], g, self.freq_sd_hz[g]) for g in groups]),
            shapes_sd=sd / length,
            damping_sd=np.array([self._sd_of_mean(self.damping[g], g, self.damping_sd[g]) for g in groups]),
            source=f"mean of {len(self.estimates)} estimates",
        )
        scatter = np.array([_sd(self.freq_hz[g]) for g in groups])
        shape_scatter = np.stack([_sd(a) for a in aligned], axis=1)
        counts = np.array([len(g) for g in groups])
        return CombinedModes(modes, scatter, shape_scatter, counts, self._by_method(groups), dropped)

    def _by_method(self, groups: list[NDArray[np.int64]]) -> dict[str, Reals]:
        methods = [e.method for e in self.estimates]
        of = np.array(methods)[self.source]
        own = {m: [g[of[g] == m] for g in groups] for m in dict.fromkeys(methods)}
        return {m: np.array([_mean(self.freq_hz[g], self.weights[g]) for g in some]) for m, some in own.items()}

    def _sd_of_mean(self, values: Reals, group: NDArray[np.int64], own: Reals) -> Reals:
        """Standard errors of means of values (…, members) over fragments, whose variances go with 1/length.

        Parameters
        ----------
        own : (…, members) standard deviations that a method states itself, NaN without them
        """
        fragment = np.array([self.estimates[i].fragment for i in self.source[group]])
        known, stated = _without_nan(values), _without_nan(own)
        numbers = np.unique(fragment[known])
        weights = np.array([self.weights[group][fragment == n][0] for n in numbers])
        all_stated = len(numbers) > 0 and all(stated[fragment == n].any() for n in numbers)
        by_methods = np.full(values.shape[:-1], np.nan)
        if all_stated:
            each = np.stack([own[..., stated & (fragment == n)][..., 0] for n in numbers], axis=-1)
            by_methods = np.sqrt((weights**2 * each**2).sum(axis=-1)) / weights.sum()
        if len(numbers) < 2:
            return np.asarray(by_methods)
        means = np.stack([values[..., known & (fragment == n)].mean(axis=-1) for n in numbers], axis=-1)
        away = means - np.average(means, axis=-1, weights=weights)[..., None]
        scatter = np.sqrt((weights * away**2).sum(axis=-1) / (weights.sum() * (len(numbers) - 1)))
        if not all_stated or len(numbers) >= ENOUGH_FRAGMENTS:
            return np.asarray(scatter)
        # a few fragments tell their scatter with a large error: it counts where it is far above that of the methods
        limit = fdtri(len(numbers) - 1, PIECES * len(numbers), 1.0 - BY_CHANCE)
        return np.asarray(np.where(scatter**2 > limit * by_methods**2, scatter, by_methods))


ENOUGH_FRAGMENTS = 10
"""Fragments whose scatter alone gives standard deviations, with an error of a quarter."""
PIECES = 20
"""Degrees of freedom of the standard deviation that a method states for a fragment: pieces of which it is made."""
BY_CHANCE = 0.01
"""Probability with which a scatter by chance counts in place of the deviations of the methods."""


def _or_nan(values: Reals | None, like: Reals) -> Reals:
    return np.full(like.shape, np.nan) if values is None else values


def _without_nan(values: Reals) -> NDArray[np.bool_]:
    """(members,) where no entry of values (…, members) is NaN."""
    return np.asarray(~np.isnan(values).any(axis=tuple(range(values.ndim - 1))), dtype=bool)


def _aligned(shapes: Reals) -> Reals:
    """Unit shapes with the sign of the one that is most like all others."""
    inner = shapes.T @ shapes
    leader = int((inner**2).sum(axis=0).argmax())
    signs = np.where(inner[leader] < 0.0, -1.0, 1.0)
    turned = shapes * signs
    top = int(np.abs(turned[:, leader]).argmax())
    return np.asarray(turned * (1.0 if turned[top, leader] > 0.0 else -1.0))


def _mean(values: Reals, weights: Reals) -> float:
    known = ~np.isnan(values)
    return float(np.average(values[known], weights=weights[known])) if known.any() else float("nan")


def _sd(values: Reals) -> Reals:
    return np.asarray(values.std(axis=-1, ddof=1) if values.shape[-1] > 1 else np.full(values.shape[:-1], np.nan))
