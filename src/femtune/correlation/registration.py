"""Rigid motions that put the points of a test onto the grid points of a model, found by consensus.

A motion is x_model = rotation · (factor · x_test) + origin. Motions are proposed by triples of test points whose
three distances occur in the mesh (RANSAC; Fischler and Bolles 1981), compared by a likelihood in which some points may
have no partner (MLESAC; Torr and Zisserman 2000), and refined by weighted least squares on nearest grid points (ICP;
Besl and McKay 1992). Places shifted by one element and symmetries of the mesh are tried as well, so that a motion is
called unique only if these fit worse.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from femtune.arrays import Integers, Reals

PARTNER = 0.5
"""Largest distance of a test point from its grid point, over the distance of the grid point from its nearest neighbour.
Beyond it another grid point can be as near."""
_NO_PARTNER = 0.2
"""Probability that a test point has no grid point in the model."""
_SCATTERS = (0.003, 0.01, 0.03, 0.1, 0.2, 0.3)
"""Standard deviations of test points over the spacing of the mesh among which the likelihood chooses."""
_COARSE_SCATTERS = (0.3, 0.7, 1.5, 3.0)
"""The same while motions are searched."""
MARGIN = 5.0
"""Difference of log-likelihoods from which one motion is preferred to another: odds of 150 to 1."""
_MODEL_AXES = 8.0
"""Log-likelihood that coordinates as they are in the file may lose: the 99 % quantile of what a fit of six numbers
gains by chance."""
_SIMPLE = 1.5
"""Log-likelihood that exchanged axes gain before others, and unchanged axes once more: they decide between motions that
fit equally well."""
_LEFT_HANDED = 10.0
"""Log-likelihood by which left-handed axes must be better than the best right-handed ones."""
_LEAST_SHARE = 0.7
"""Part of the points that must have a grid point of their own."""
_MOST_COARSE = 300
"""Grid points of the search; of larger meshes points that lie far apart are taken."""
_MOST_SCORED = 60
"""Test points of the search."""
_TRIPLES = 4
"""Triples of test points that propose motions in a round."""
_ROUNDS = 4
"""Rounds until most points have a partner."""
_TRIES = 60
"""Triples that are tried at most."""
_MOST_PAIRS = 4000
"""Pairs of grid points for the first side of a triple that are kept, drawn at random."""
_MOST_HYPOTHESES = 4000
"""Motions that a triple proposes that are kept, drawn at random."""
_FINALISTS = 24
"""Motions that are refined."""
_ITERATIONS = 12
"""Steps of the refinement."""
_LEAST_POINTS = 3
"""Points that fix a rigid motion."""
_SAME_PLACE = 0.1
"""Distance over the spacing of the mesh up to which a symmetry puts a grid point onto another."""
_SYMMETRIC = 0.98
"""Part of the grid points that a symmetry puts onto others."""
_COVERED = 0.35
"""Extent of the middle three quarters of the points over that of the mesh from which other units are not tried."""
_FEW_POINTS = 8
"""Points below which a motion must fit better than within half an element."""
_FEW_PARTNER = 0.15
"""Distance over the spacing of the mesh within which it must fit then."""
_FLAT = 0.05
"""Extent across a line or a plane over the spacing of the mesh below which points are on it."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A rigid motion with the factor of a change of units.

    Parameters
    ----------
    rotation : (3, 3) orthonormal; determinant −1 for left-handed axes of the test
    origin : (3,) of the test in the model
    factor : of coordinates
    fit : log-likelihood of the points
    grids : (n,) rows of the grid points of the test points; −1 without one
    distance : (n,) to the nearest grid point
    """

    rotation: Reals
    origin: Reals
    factor: float
    fit: float
    grids: Integers
    distance: Reals

    @property
    def is_left_handed(self) -> bool:
        """Whether the axes of the test are left-handed."""
        return bool(np.linalg.det(self.rotation) < 0.0)

    @property
    def is_unchanged(self) -> bool:
        """Whether test and model have the same axes, origin and unit."""
        return self.factor == 1.0 and not self.origin.any() and bool((self.rotation == np.eye(3)).all())

    def __call__(self, points: Reals) -> Reals:
        """Points of the test in the model."""
        return np.asarray(self.factor * points @ self.rotation.T + self.origin)


def register(
    points: Reals,
    grids: Reals,
    *,
    factors: Sequence[float] = (1.0,),
    pairs: Integers | None = None,
    seed: int = 0,
) -> tuple[Motion, ...]:
    """Motions that put test points onto grid points, the best one first, then those that are nearly as good.

    Coordinates as they are in the file are preferred unless another motion is better by more than a fit of its six
    numbers gains by chance. Left-handed axes are taken only where no right-handed axes explain the points. Factors are
    tried in their order until one puts most points onto the mesh and covers much of it.

    Parameters
    ----------
    points : (n, 3) of the test
    grids : (m, 3) of the model
    factors : of coordinates, for changes of units
    pairs : (n,) rows of the grid points that have the numbers of the test points, −1 without one; they propose a motion
    seed : of the random search

    Returns
    -------
    motions : () where no motion puts 70 % of the points within half an element of grid points of their own; fewer than
        eight points must be within 15 % of an element, because a motion can be fitted to any few points

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.correlation.registration import register
    >>> x, y = np.meshgrid(np.arange(8.0), np.arange(5.0))
    >>> grids = np.column_stack([x.ravel(), y.ravel(), 0.02 * x.ravel() ** 2])
    >>> test = grids[[0, 3, 7, 18, 24, 32, 36, 39]] - [30.0, 0.0, 2.0]
    >>> found = register(test, grids)
    >>> found[0].origin.round(6), found[0].grids
    (array([30.,  0.,  2.]), array([ 0,  3,  7, 18, 24, 32, 36, 39]))
    """
    different, inverse = np.unique(points, axis=0, return_inverse=True)
    inverse = inverse.ravel()
    if len(different) < 2 or len(grids) < 2 or not np.ptp(grids, axis=0).any():
        return ()
    mesh = _Mesh(grids)
    first = np.array([int(np.flatnonzero(inverse == k)[0]) for k in range(len(different))])
    by_number = None if pairs is None else pairs[first]
    every: list[Motion] = []
    for factor in factors:
        search = _Search(factor * different, mesh, by_number, np.random.default_rng(seed))
        if not search.is_possible:
            continue
        motions = [replace(one, factor=factor) for one in search.motions()]
        every += motions
        if motions and search.covers and np.mean(motions[0].grids >= 0) >= 1.0 - _NO_PARTNER:
            break
    best = max((one.fit + _MODEL_AXES * (one.factor == 1.0) for one in every), default=0.0)
    near = (one for one in every if one.fit + _MODEL_AXES * (one.factor == 1.0) > best - MARGIN)
    # places of all points, also of those that share coordinates
    return tuple(replace(one, grids=one.grids[inverse], distance=one.distance[inverse]) for one in near)


class _Mesh:
    """Grid points with their spacing."""

    def __init__(self, grids: Reals) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415  slow to import

        self.xyz = grids
        size = float(np.linalg.norm(np.ptp(grids, axis=0)))
        # coincident grid points have no spacing
        _, self.own = np.unique(np.round(grids / (1e-7 * size)), axis=0, return_index=True)
        self.places = grids[self.own]
        self.tree = cKDTree(self.places)
        near = self.tree.query(self.places, k=min(7, len(self.places)))
        self.neighbours = near[1][:, 1:]
        spacing = near[0][:, 1]
        self.spacing_median = float(np.median(spacing))
        self.spacing = np.clip(spacing, 0.25 * self.spacing_median, 2.0 * self.spacing_median)
        self.size = size
        self.coarse = self.places[_spread(self.places, _MOST_COARSE)]
        gap = cKDTree(self.coarse).query(self.places)[0].max()
        self.coarse_gap = float(gap) if len(self.coarse) < len(self.places) else 0.0
        reach = self.spacing_median * max(_COARSE_SCATTERS) + self.coarse_gap
        self.reach = 2.0 * reach
        # density of points without partner, per square of the spacing
        self.background = _NO_PARTNER * (self.spacing_median / (2.0 * size)) ** 2

    def nearest(self, points: Reals) -> tuple[Reals, Integers]:
        """Distance over spacing and row in `places`; infinite beyond the reach."""
        flat = points.reshape(-1, 3)
        distance, at = self.tree.query(flat, distance_upper_bound=self.reach)
        inside = at < len(self.places)
        at = np.where(inside, at, 0)
        return np.where(inside, distance / self.spacing[at], np.inf).reshape(points.shape[:-1]), at.reshape(
            points.shape[:-1]
        )

    @cached_property
    def symmetries(self) -> _Batch:
        """Rotations by quarter and half turns that put the mesh onto itself."""
        centre = self.places.mean(axis=0)
        principal = np.linalg.svd(self.coarse - centre, full_matrices=True)[2]
        turns = signed_permutations()[1:24]
        every = np.concatenate([turns, principal.T @ turns @ principal])
        batch = _Batch(every, centre - every @ centre)
        for points in (self.coarse, self.places):
            there = self.nearest(batch.moved(points))[0] <= _SAME_PLACE
            batch = batch.take(np.flatnonzero(there.mean(axis=1) >= _SYMMETRIC))
        return batch

    def fit(self, relative: Reals, scatters: Sequence[float]) -> tuple[Reals, Reals]:
        """Log-likelihood (b,) of relative distances (b, n) with the best scatter, and that scatter."""
        best, chosen = np.full(len(relative), -np.inf), np.full(len(relative), scatters[0])
        for s in scatters:
            inlier = (
                (1.0 - _NO_PARTNER) / (2.0 * np.pi * s**2) * np.exp(-0.5 * np.square(np.minimum(relative / s, 30.0)))
            )
            value = np.log(inlier + self.background).sum(axis=-1)
            better = value > best
            best, chosen = np.where(better, value, best), np.where(better, s, chosen)
        return best, chosen


@dataclass(frozen=True, eq=False)
class _Batch:
    """Rotations (b, 3, 3) and origins (b, 3)."""

    rotation: Reals
    origin: Reals

    def __len__(self) -> int:
        return len(self.rotation)

    def take(self, rows: Integers) -> _Batch:
        return _Batch(self.rotation[rows], self.origin[rows])

    def moved(self, points: Reals) -> Reals:
        """(b, n, 3)."""
        return np.asarray(np.einsum("bij,nj->bni", self.rotation, points) + self.origin[:, None, :])


def _joined(batches: Sequence[_Batch]) -> _Batch:
    return _Batch(np.concatenate([b.rotation for b in batches]), np.concatenate([b.origin for b in batches]))


class _Search:
    """The search with one factor."""

    def __init__(self, points: Reals, mesh: _Mesh, by_number: Integers | None, random: np.random.Generator) -> None:
        self.points, self.mesh, self.by_number, self.random = points, mesh, by_number, random
        self.some = points[_spread(points, _MOST_SCORED)]
        centred = points - np.median(points, axis=0)
        # the middle three quarters: points without partner may lie anywhere
        distance = np.linalg.norm(centred, axis=1)
        core = centred[np.argsort(distance)[: max(2, int(np.ceil(0.75 * len(points))))]]
        self.core_size = float(np.linalg.norm(core[:, None] - core[None], axis=2).max())
        extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
        limit = _FLAT * mesh.spacing_median
        self.on_line = len(points) < _LEAST_POINTS or extents[1] <= limit
        self.on_plane = self.on_line or extents[2] <= limit

    @property
    def covers(self) -> bool:
        """Whether the points extend over much of the mesh, as sensors do: other units would make them too large or too
        small."""
        return self.core_size >= _COVERED * self.mesh.size

    @property
    def is_possible(self) -> bool:
        """Whether the points are as large as the mesh, roughly: not larger, and not within a few elements."""
        large = self.core_size > 1.2 * self.mesh.size
        small = self.core_size < 1.5 * self.mesh.spacing_median and len(self.points) > 2
        return not large and not small

    def motions(self) -> tuple[Motion, ...]:
        """The best motion and those that are nearly as good; () if none puts most points onto the mesh."""
        proposals = [_Batch(np.eye(3)[None], np.zeros((1, 3))), *self._simple(), *self._by_number()]
        motions: list[Motion] = []
        triples = self._proposed()
        for _ in range(_ROUNDS):
            proposals += [self._preselected(one) for one in itertools.islice(triples, _TRIPLES)]
            settled = self._refined(self._walked(self._best(_joined(proposals), _FINALISTS)))
            motions = self._distinct(settled)
            if np.mean(motions[0].grids >= 0) >= 1.0 - _NO_PARTNER:
                break
            proposals = [_stack(motions)]
        for _ in range(_ROUNDS):
            before = _best_of_each_hand(motions)
            steps = self._refined(_joined([self._one_step(one) for one in before]))
            motions = self._distinct(_joined([_stack(motions), steps]))
            if all(new.fit <= old.fit + 1e-6 for new, old in zip(_best_of_each_hand(motions), before)):
                break
        motions = [self._simplified(one) for one in motions]
        as_they_are = self._motion(np.eye(3), np.zeros(3))
        return _ranked(as_they_are, [one for one in motions if self._holds(one)], self._holds(as_they_are))

    # ---------------------------------------------------------------- proposals

    def _simple(self) -> Iterator[_Batch]:
        """Exchanged axes, with the origin of the model, and with the middle of the points in the middle of the mesh."""
        rotations = signed_permutations()
        if self.on_plane:
            rotations = rotations[np.linalg.det(rotations) > 0.0]
        yield _Batch(rotations, np.zeros((len(rotations), 3)))
        turned = np.einsum("bij,nj->bni", rotations, self.points)
        for middle in (_middle, _median):
            of_points = np.array([middle(one) for one in turned])
            yield _Batch(rotations, middle(self.mesh.places) - of_points)

    def _by_number(self) -> Iterator[_Batch]:
        """Motions that put triples of points onto the grid points with their numbers."""
        if self.by_number is None or (self.by_number >= 0).sum() < _LEAST_POINTS:
            return
        known = np.flatnonzero(self.by_number >= 0)
        a, b = self.points[known], self.mesh.xyz[self.by_number[known]]
        triples = np.array([self.random.choice(len(known), _LEAST_POINTS, replace=False) for _ in range(200)])
        triples = np.concatenate([triples, _spread(a, _LEAST_POINTS)[None]])
        yield from self._of_triples(a[triples], b[triples])

    def _proposed(self) -> Iterator[_Batch]:
        """Motions of triples of test points whose distances occur in the mesh; of pairs for points on a line."""
        mesh = self.mesh.coarse
        between = np.linalg.norm(mesh[:, None] - mesh[None], axis=2)
        slack = 0.6 * self.mesh.spacing_median + self.mesh.coarse_gap
        for _ in range(_TRIES):
            a = self._long_triple()
            pairs = self._some(np.argwhere(np.abs(between - np.linalg.norm(a[0] - a[1])) <= slack), _MOST_PAIRS)
            if self.on_line:
                proposed = [*self._of_pairs(a, mesh[pairs])] if len(pairs) else []
            else:
                third = np.abs(between[pairs[:, 0]] - np.linalg.norm(a[0] - a[2])) <= slack
                third &= np.abs(between[pairs[:, 1]] - np.linalg.norm(a[1] - a[2])) <= slack
                rows, k = np.nonzero(third)
                hits = self._some(np.column_stack([pairs[rows], k]), _MOST_HYPOTHESES)
                proposed = [*self._of_triples(np.broadcast_to(a, (len(hits), 3, 3)), mesh[hits])] if len(hits) else []
            if proposed:
                yield _joined(proposed)

    def _long_triple(self) -> Reals:
        """Three of a few points at random that are far apart; two for points on a line.

        Points without partner are often outside the structure, so that the farthest ones of all would be these.
        """
        few = self.points[self.random.choice(len(self.points), min(len(self.points), 5), replace=False)]
        a = few[_spread(few, 2 if self.on_line else _LEAST_POINTS)]
        return np.asarray(a[self.random.permutation(len(a))])

    def _some(self, rows: Integers, most: int) -> Integers:
        if len(rows) <= most:
            return rows
        return np.asarray(rows[self.random.choice(len(rows), most, replace=False)])

    def _of_triples(self, a: Reals, b: Reals) -> Iterator[_Batch]:
        """Motions of triangles a onto triangles b (k, 3, 3), and the left-handed ones."""
        of_a, of_b = _frames(a), _frames(b)
        good = np.isfinite(of_a).all(axis=(1, 2)) & np.isfinite(of_b).all(axis=(1, 2))
        of_a, of_b, a, b = of_a[good], of_b[good], a[good], b[good]
        if not len(of_a):
            return
        for third in (1.0,) if self.on_plane else (1.0, -1.0):
            rotation = np.einsum("bki,k,bkj->bij", of_b, np.array([1.0, 1.0, third]), of_a)
            yield _Batch(rotation, b.mean(axis=1) - np.einsum("bij,bj->bi", rotation, a.mean(axis=1)))

    def _of_pairs(self, a: Reals, b: Reals) -> Iterator[_Batch]:
        """Motions of a line onto lines (k, 2, 3) with the smallest rotation."""
        along = a[1] - a[0]
        rotation = np.array([_turn(along, one[1] - one[0]) for one in b])
        yield _Batch(rotation, b.mean(axis=1) - rotation @ a.mean(axis=0))

    def _preselected(self, batch: _Batch) -> _Batch:
        """Those that put a few points near the mesh."""
        few = self.points[_spread(self.points, 8)]
        return batch.take(self._order(batch, few, 250))

    def _order(self, batch: _Batch, points: Reals, most: int) -> Integers:
        relative, _ = self.mesh.nearest(batch.moved(points))
        return np.argsort(-self.mesh.fit(relative, self._coarse_scatters)[0], kind="stable")[:most]

    @property
    def _coarse_scatters(self) -> tuple[float, ...]:
        wide = self.mesh.coarse_gap / self.mesh.spacing_median
        return (*_COARSE_SCATTERS, *(() if wide <= _COARSE_SCATTERS[-1] else (wide,)))

    def _best(self, batch: _Batch, count: int) -> _Batch:
        """The best ones that differ by more than an element."""
        order = self._order(batch, self.some, len(batch))
        moved = batch.take(order[:2000]).moved(self.some)
        kept: list[int] = []
        for i in range(len(moved)):
            apart = [np.sqrt(((moved[i] - moved[j]) ** 2).sum(axis=1).mean()) for j in kept]
            if all(x > max(self.mesh.spacing_median, self.mesh.coarse_gap) for x in apart):
                kept.append(i)
            if len(kept) >= count:
                break
        return batch.take(order[kept])

    # ---------------------------------------------------------------- refinement

    def _walked(self, batch: _Batch) -> _Batch:
        """Each motion improved by random steps that become smaller: on a fine mesh nearest points alone stall."""
        h, b = self.mesh.spacing_median, len(batch)
        centre = np.median(self.some, axis=0)
        arm = max(float(np.median(np.linalg.norm(self.some - centre, axis=1))), h)
        scatters = (*_SCATTERS[3:], *self._coarse_scatters)
        value = self.mesh.fit(self.mesh.nearest(batch.moved(self.some))[0], scatters)[0]
        rotation, origin = batch.rotation.copy(), batch.origin.copy()
        tries = 40
        for step in (*(self.mesh.coarse_gap * np.array([1.0, 0.5])), 2.0 * h, h, h, 0.6 * h, 0.3 * h, 0.3 * h):
            if step == 0.0:
                continue
            shift = step * self.random.standard_normal((b, tries, 3))
            turn = _rotations((step / arm) * self.random.standard_normal((b * tries, 3))).reshape(b, tries, 3, 3)
            if self.on_line:
                turn[:, : tries // 2] = np.eye(3)
            turned = np.einsum("btij,bjk->btik", turn, rotation)
            # turned about the middle of the points
            at = np.einsum("bij,j->bi", rotation, centre) + origin
            moved = at[:, None] + shift - np.einsum("btij,j->bti", turned, centre)
            trial = _Batch(turned.reshape(-1, 3, 3), moved.reshape(-1, 3))
            values = self.mesh.fit(self.mesh.nearest(trial.moved(self.some))[0], scatters)[0].reshape(b, tries)
            best = values.argmax(axis=1)
            rows = np.flatnonzero(values[np.arange(b), best] > value)
            rotation[rows], origin[rows] = turned[rows, best[rows]], moved[rows, best[rows]]
            value[rows] = values[rows, best[rows]]
        return _Batch(rotation, origin)

    def _refined(self, batch: _Batch, turns: bool = True) -> _Batch:
        """Weighted least squares on nearest grid points."""
        rotation, origin = batch.rotation, batch.origin
        for _ in range(_ITERATIONS):
            moved = _Batch(rotation, origin).moved(self.points)
            relative, at = self.mesh.nearest(moved)
            _, scatter = self.mesh.fit(relative, _SCATTERS)
            turn, shift = _small_motions(moved, self.mesh.places[at], self._weights(relative, at, scatter), turns)
            rotation = turn @ rotation
            origin = np.einsum("bij,bj->bi", turn, origin) + shift
            if np.abs(_Batch(rotation, origin).moved(self.points) - moved).max() <= 1e-12 * self.mesh.size:
                break
        return _Batch(rotation, origin)

    def _weights(self, relative: Reals, at: Integers, scatter: Reals) -> Reals:
        """Probability that a point belongs to its nearest grid point; of several at one grid point the nearest one."""
        s = scatter[:, None]
        inlier = (1.0 - _NO_PARTNER) / (2.0 * np.pi * s**2) * np.exp(-0.5 * np.square(np.minimum(relative / s, 30.0)))
        weight = inlier / (inlier + self.mesh.background)
        return np.where(_own(relative, at) & (relative <= 2.0 * PARTNER), weight, 0.0)

    def _one_step(self, one: Motion) -> _Batch:
        """The motion shifted along the mesh by one element and by two, after half turns and symmetries of the mesh."""
        used = np.unique(one.grids[one.grids >= 0])
        rows = np.flatnonzero(np.isin(self.mesh.own, used))
        steps = self.mesh.places[self.mesh.neighbours[rows]] - self.mesh.places[rows, None]
        steps = steps.reshape(-1, 3)
        kept: list[Reals] = []
        for step in steps[:600]:
            if all(np.linalg.norm(step - other) > 0.5 * self.mesh.spacing_median for other in kept):
                kept.append(step)
        shifts = np.array([sign * k * s for s in kept[:20] for sign in (1.0, -1.0) for k in (1.0, 2.0)]).reshape(-1, 3)
        shifts = np.unique(np.round(shifts, 12), axis=0)
        moved = self.points @ one.rotation.T + one.origin
        centre = moved[one.grids >= 0].mean(axis=0) if (one.grids >= 0).any() else moved.mean(axis=0)
        axes = np.linalg.svd(moved - centre, full_matrices=True)[2]
        halves = np.array([2.0 * np.outer(a, a) - np.eye(3) for a in (*axes, *np.eye(3))])
        symmetries = self.mesh.symmetries
        return _Batch(
            np.concatenate(
                [
                    np.broadcast_to(one.rotation, (len(shifts), 3, 3)),
                    halves @ one.rotation,
                    symmetries.rotation @ one.rotation,
                ]
            ),
            np.concatenate(
                [
                    one.origin + shifts,
                    halves @ (one.origin - centre) + centre,
                    symmetries.rotation @ one.origin + symmetries.origin,
                ]
            ),
        )

    # ---------------------------------------------------------------- the result

    def _motions_of(self, batch: _Batch) -> Iterator[Motion]:
        """The motions, the best one first."""
        moved = batch.moved(self.points)
        relative, at = self.mesh.nearest(moved)
        own = _own(relative, at)
        fit, _ = self.mesh.fit(np.where(own, relative, np.inf), _SCATTERS)
        limit = PARTNER if len(self.points) >= _FEW_POINTS else _FEW_PARTNER
        grids = np.where(own & (relative <= limit), self.mesh.own[at], -1)
        for i in np.argsort(-fit, kind="stable"):
            distance, _ = self.mesh.tree.query(moved[i])
            yield Motion(batch.rotation[i], batch.origin[i], 1.0, float(fit[i]), grids[i], distance)

    def _motion(self, rotation: Reals, origin: Reals) -> Motion:
        return next(self._motions_of(_Batch(rotation[None], origin[None])))

    def _distinct(self, batch: _Batch) -> list[Motion]:
        """The best ones, without those that put the points to the same places."""
        kept: list[Motion] = []
        for one in self._motions_of(batch):
            if kept and (kept[0].fit - one.fit > 3.0 * _LEFT_HANDED or len(kept) == _FINALISTS):
                break
            if not any(_alike(one, other, self.points, self.mesh.spacing_median) for other in kept):
                kept.append(one)
        return kept

    def _simplified(self, one: Motion) -> Motion:
        """With axes that are exactly exchanged ones, and the origin of the model, where these fit nearly as well."""
        clean = np.where(np.abs(one.rotation) > np.sqrt(0.5), np.sign(one.rotation), 0.0)
        if np.abs(np.abs(clean).sum(axis=0) - 1.0).any() or np.abs(np.abs(clean).sum(axis=1) - 1.0).any():
            return one
        allowed = one.fit - 0.5 * _MODEL_AXES
        centre = self.points.mean(axis=0)
        start = _Batch(clean[None], (one.rotation @ centre + one.origin - clean @ centre)[None])
        simple = next(self._motions_of(self._refined(start, turns=False)))
        rotation, origin = simple.rotation, simple.origin
        if simple.fit < allowed:
            return one
        zero = self._motion(rotation, np.where(np.abs(origin) < PARTNER * self.mesh.spacing_median, 0.0, origin))
        return zero if zero.fit >= allowed else simple

    def _holds(self, one: Motion) -> bool:
        """Whether most points have a grid point of their own: all of four, and 70 % of more."""
        placed = int((one.grids >= 0).sum())
        n = len(self.points)
        return placed >= min(n, max(4, int(np.ceil(_LEAST_SHARE * n))))


def _ranked(as_they_are: Motion, motions: Sequence[Motion], holds: bool) -> tuple[Motion, ...]:
    """The preferred motion, and those that are nearly as good."""
    best = max((one.fit for one in motions), default=-np.inf)
    if holds and as_they_are.fit >= best - _MODEL_AXES:
        return (as_they_are,)
    right = [one for one in motions if not one.is_left_handed]
    left = [one for one in motions if one.is_left_handed]
    best_right = max((one.fit for one in right), default=-np.inf)
    kept = left if left and best - best_right > _LEFT_HANDED else right
    top = max((one.fit for one in kept), default=0.0)
    near = [one for one in kept if one.fit > top - MARGIN]
    near = sorted(near, key=lambda one: -(one.fit + _simplicity(one)))
    # a mesh with a plane of symmetry lets left-handed axes explain the points as well, at mirrored places
    for one in left if kept is right else []:
        if one.fit > top - MARGIN and not any((one.grids == other.grids).all() for other in near):
            near.append(one)
    return tuple(near)


def _best_of_each_hand(motions: Sequence[Motion]) -> list[Motion]:
    """The first right-handed and the first left-handed motion; the first of all where there is none."""
    return [next((one for one in motions if one.is_left_handed == hand), motions[0]) for hand in (False, True)]


def _simplicity(one: Motion) -> float:
    """Log-likelihood that a motion gains before others by being simple: first without rotation, then exchanged axes."""
    angle = float(np.arccos(np.clip(0.5 * (abs(np.trace(one.rotation)) - 1.0), -1.0, 1.0)))
    exchanged = bool(np.isin(one.rotation, (-1.0, 0.0, 1.0)).all())
    return _SIMPLE * ((angle == 0.0) + exchanged) - 0.1 * angle


def is_symmetry(first: Motion, second: Motion, grids: Reals) -> bool:
    """Whether the two motions differ by a motion that puts the mesh (m, 3) onto itself."""
    from scipy.spatial import cKDTree  # noqa: PLC0415  slow to import

    turn = second.rotation @ first.rotation.T
    moved = (grids - first.origin) @ turn.T + second.origin
    tree = cKDTree(grids)
    spacing = tree.query(grids, k=2)[0][:, 1]
    return bool(np.mean(tree.query(moved)[0] <= PARTNER * np.median(spacing)) >= _SYMMETRIC)


def signed_permutations() -> Reals:
    """(48, 3, 3) exchanges and reversals of axes, the identity first, right-handed ones before the others."""
    every = []
    for order, signs in itertools.product(itertools.permutations(range(3)), itertools.product((1, -1), repeat=3)):
        matrix = np.zeros((3, 3))
        matrix[range(3), order] = signs
        every.append(matrix)
    return np.array(sorted(every, key=lambda one: np.linalg.det(one) < 0.0))


def _stack(motions: Sequence[Motion]) -> _Batch:
    return _Batch(np.array([one.rotation for one in motions]), np.array([one.origin for one in motions]))


def _alike(one: Motion, other: Motion, points: Reals, spacing: float) -> bool:
    """Whether two motions of the same handedness put the points to the same places, within half an element."""
    if one.is_left_handed != other.is_left_handed:
        return False
    apart = points @ (one.rotation - other.rotation).T + one.origin - other.origin
    return bool(np.sqrt((apart**2).sum(axis=1).mean()) <= 0.5 * spacing)


def _own(relative: Reals, at: Integers) -> np.ndarray:
    """Whether each point (b, n) is the nearest one of those of its row that have the same grid point."""
    key = (at + (int(at.max(initial=0)) + 1) * np.arange(len(at))[:, None]).ravel()
    order = np.lexsort((relative.ravel(), key))
    first = np.ones(len(key), bool)
    first[1:] = key[order][1:] != key[order][:-1]
    own = np.zeros(len(key), bool)
    own[order] = first
    return own.reshape(at.shape) & np.isfinite(relative)


def _spread(points: Reals, count: int) -> Integers:
    """Rows of points, each the farthest from those before it; the first is farthest from the middle."""
    if len(points) <= count:
        return np.arange(len(points))
    chosen = [int(np.argmax(np.sum((points - np.median(points, axis=0)) ** 2, axis=1)))]
    away = np.sum((points - points[chosen[0]]) ** 2, axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.sum((points - points[chosen[-1]]) ** 2, axis=1))
    return np.array(chosen)


def _middle(points: Reals) -> Reals:
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def _median(points: Reals) -> Reals:
    return np.asarray(np.median(points, axis=0))


def _frames(triangles: Reals) -> Reals:
    """(k, 3, 3) rows are the unit vectors along the first side, across it in the plane, and normal; NaN if flat."""
    side, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(side, other)
    with np.errstate(invalid="ignore", divide="ignore"):
        x = side / np.linalg.norm(side, axis=1, keepdims=True)
        z = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    flat = np.linalg.norm(normal, axis=1) <= 1e-3 * np.linalg.norm(side, axis=1) * np.linalg.norm(other, axis=1)
    frames = np.stack([x, np.cross(z, x), z], axis=1)
    frames[flat] = np.nan
    return frames


def _turn(a: Reals, b: Reals) -> Reals:
    """The smallest rotation of direction a into direction b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    if np.linalg.norm(axis) < 1e-12:
        if cosine > 0.0:
            return np.eye(3)
        across = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        across /= np.linalg.norm(across)
        return np.asarray(2.0 * np.outer(across, across) - np.eye(3))
    angle = np.arctan2(np.linalg.norm(axis), cosine)
    return np.asarray(_rotations((angle * axis / np.linalg.norm(axis))[None])[0])


def _rotations(vectors: Reals) -> Reals:
    """(k, 3, 3) rotations by vectors (k, 3) in radians (Rodrigues)."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  slow to import

    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def _small_motions(points: Reals, goal: Reals, weight: Reals, turns: bool) -> tuple[Reals, Reals]:
    """Rotations and shifts with the weighted least squares of goal − points (b, n, 3), linearised; of least norm where
    points on a line leave a rotation open."""
    total = np.maximum(weight.sum(axis=1), 1e-300)[:, None]
    a, b = (np.einsum("bn,bni->bi", weight, x) / total for x in (points, goal))
    if not turns:
        return np.broadcast_to(np.eye(3), (len(a), 3, 3)), b - a
    p, e = points - a[:, None], goal - b[:, None] - points + a[:, None]
    inertia = np.einsum("bn,bni,bnj->bij", weight, p, p)
    matrix = np.trace(inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3) - inertia
    moment = np.einsum("bn,bni->bi", weight, np.cross(p, e))
    vector = np.einsum("bij,bj->bi", np.linalg.pinv(matrix, rcond=1e-9, hermitian=True), moment)
    turn = _rotations(vector)
    return turn, b - np.einsum("bij,bj->bi", turn, a)
