"""FRFs of a reduced model and their derivatives, exact within its basis.

In the modes of the reduced model, H = Ψ_o Z⁻¹ Ψ_iᵀ with Z = K̂ + s²M̂ + s(Ĉ + D̂) + iĤ. The basis does not change with the
parameters, so that H′ = −y (K̂′ + s²M̂′ + s(Ĉ′ + D̂′) + iĤ′) x with the responses x to the inputs and y to unit forces at
the outputs. Modal damping D = MΦ diag(d)ΦᵀM is a function of the matrix M⁻¹K: its derivative follows from divided
differences of d(λ) (Daleckii and Krein's formula), which also holds for repeated and crossing modes.

Where the damping couples no modes, those far above the lines respond smoothly over frequency: their part is computed
at Chebyshev points only and interpolated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Complexes, Integers, Reals
from femtune.model.reduce.modes_in_basis import ReducedModes, elastic, reduced_derivative
from femtune.model.reduce.reduced_model import ReducedPoint
from femtune.model.response.basis import ModalBasis
from femtune.model.response.modal_damping import DampingRatios, ModalRates, divided, modal_rates
from femtune.model.response.reduced import ReducedStiffness, fields, slim

SMOOTH_ABOVE = 2.0
"""Modes above this many times the highest line respond smoothly over the lines."""
_CHEBYSHEV_POINTS = 12
"""With poles beyond SMOOTH_ABOVE times the highest line, the interpolation has a relative error of 4 · 5.8⁻¹² =
3e-9."""


@dataclass(frozen=True, eq=False)
class BasisPorts:
    """Forces and motions on the basis of a reduced model.

    Parameters
    ----------
    inputs : VᵀB (r, b)
    outputs : C V (a, r)
    """

    inputs: Reals
    outputs: Reals


@dataclass(frozen=True, eq=False)
class FunctionsInBasis:
    """Receptances (k, a, b) and their derivatives (k, a, b, p) by the normalised free parameters."""

    values: Complexes
    gradient: Complexes


def reduced_functions(
    modes: ReducedModes,
    ports: BasisPorts,
    s: Complexes,
    damped: int,
    damping: DampingRatios | None = None,
    derivatives: bool = True,
    left_out: Sequence[int] = (),
) -> FunctionsInBasis:
    """Receptances of a reduced model at s = σ + iω.

    Parameters
    ----------
    modes : all modes of the reduced model at a point
    s : (k,) σ + iω, ω > 0, of one σ
    damped : number of modes, the lowest ones, that modal damping acts on
    damping : modal damping, besides that of the model; ratios that are values of the model take its place
    left_out : positions of modes whose own response is taken away, see `femtune.model.response.frf_gradient`
    derivatives : without them the gradient has no columns

    Returns
    -------
    FunctionsInBasis : NaN at lines where the response is infinite

    Raises
    ------
    FemtuneError : ``response.damping-ratio`` and what the damping raises
    """
    system = _System.of(modes, ports, s, damped, damping)
    count = modes.point.n_parameters if derivatives else 0
    functions = _all_modes(system, s, count)
    if not left_out:
        return functions
    part = _some_modes(system, list(left_out), ports, s, count)
    return FunctionsInBasis(functions.values - part.values, functions.gradient - part.gradient)


def _all_modes(system: _System, s: Complexes, count: int) -> FunctionsInBasis:
    if system.stiffness.is_diagonal:
        return _split(system, s, count)
    forces = np.hstack([system.stiffness.inputs, system.stiffness.outputs.T])
    both, b = fields(system.stiffness, s, forces), system.stiffness.inputs.shape[1]
    x, y = both[:, :, :b], np.swapaxes(both[:, :, b:], 1, 2)
    gradient = np.zeros((len(s), y.shape[1], b, count), complex)
    for p in system.acting(count):
        for weight, matrix in system.changes(p, s):
            gradient[..., p] -= weight[:, None, None] * (y @ (matrix @ x))
    return FunctionsInBasis(np.asarray(system.stiffness.outputs @ x), gradient)


def _some_modes(
    system: _System, members: Sequence[int], ports: BasisPorts, s: Complexes, count: int
) -> FunctionsInBasis:
    """The response CQ (QᵀZQ)⁻¹ QᵀB of some modes Q, which depends on their span only."""
    modes, at = system.modes, np.array(members, dtype=int)
    point, Q = modes.point, modes.shapes[:, at]
    basis = ModalBasis(Q, modes.eigenvalues[at], np.ones(len(at)), len(at))
    viscous, hysteretic = system.damping_of(Q, at)
    of = ReducedStiffness(basis, viscous, hysteretic, Q.T @ ports.inputs, ports.outputs @ Q)
    both, b = fields(of, s, np.hstack([of.inputs, of.outputs.T])), of.inputs.shape[1]
    x, y = both[:, :, :b], np.swapaxes(both[:, :, b:], 1, 2)
    values = np.asarray(of.outputs @ x)
    gradient = np.zeros((*values.shape, count), complex)
    if not count:
        return FunctionsInBasis(values, gradient)
    seen = [ports.inputs.T, ports.outputs, (point.viscous @ Q).T, (point.hysteretic @ Q).T]
    outside = reduced_derivative(modes, members, np.vstack(seen)).outside
    driven, moved, viscous, hysteretic = np.split(outside, np.cumsum([len(rows) for rows in seen[:-1]]))
    for p in system.acting(count):
        projected = [(weight, Q.T @ matrix @ Q) for weight, matrix in system.weighted(p, s)]
        # the subspace stays orthogonal in K and M as it turns, and modal damping is diagonal in it: these add nothing
        turned = [(s, viscous[:, :, p]), (np.full(len(s), 1j), hysteretic[:, :, p])]
        changes = projected + [(weight, part + part.T) for weight, part in turned]
        if system.rates is not None:
            changes.append((system.damping_weight(s), system.damping_inside(at, p, projected[0][1], projected[1][1])))
        gradient[..., p] = y @ driven[:, :, p].T + moved[:, :, p] @ x
        for weight, change in changes:
            gradient[..., p] -= weight[:, None, None] * (y @ (change @ x))
    return FunctionsInBasis(values, gradient)


@dataclass(frozen=True, eq=False)
class _System:
    """The reduced model in its modes.

    Parameters
    ----------
    vectors : (r, r) all of them; the first `near` have mass 1, the others are scaled to energy 1
    stiffness : the dynamic stiffness in these vectors
    theta : (r,) 1/(λ − σ), 0 for motions without mass
    rates : modal damping of the first modes; None without
    """

    modes: ReducedModes
    vectors: Reals
    stiffness: ReducedStiffness
    near: int
    rates: ModalRates | None

    @classmethod
    def of(
        cls, modes: ReducedModes, ports: BasisPorts, s: Complexes, damped: int, damping: DampingRatios | None
    ) -> _System:
        point, theta, shift = modes.point, modes.theta, modes.point.model.shift
        damped = min(damped, len(modes.eigenvalues))
        reach = (SMOOTH_ABOVE * np.abs(s).max()) ** 2
        near = max(damped, int(np.searchsorted(modes.eigenvalues, reach, side="right")))
        vectors = np.hstack([modes.shapes[:, :near], modes.vectors[:, near:]])
        stiffness = np.concatenate([modes.eigenvalues[:near], 1.0 + shift * theta[near:]])
        mass = np.concatenate([np.ones(near), theta[near:]])
        rates, model_ratios = None, point.full.mode_ratios
        if damping is not None or model_ratios:
            rigid = ~elastic(modes.eigenvalues[:damped])
            rates = modal_rates(modes.eigenvalues[:damped], rigid, damping, model_ratios, point.n_parameters)
        basis = ModalBasis(vectors, stiffness, mass, near)
        viscous, hysteretic = _damping(point, rates, vectors, np.arange(len(vectors)))
        inputs, outputs = vectors.T @ ports.inputs, ports.outputs @ vectors
        reduced = ReducedStiffness(basis, viscous, hysteretic, inputs, outputs)
        return cls(modes, vectors, reduced, near, rates)

    def acting(self, count: int) -> Iterator[int]:
        """Those of the first parameters that change the model: none that belong to another specimen."""
        point, rates = self.modes.point, self.rates
        for p in range(count):
            # only here, since a point for an error estimate has no derivatives
            kinds = (
                point.stiffness_derivatives, point.mass_derivatives,
                point.viscous_derivatives, point.hysteretic_derivatives,
            )  # fmt: skip
            if any(of[p].any() for of in kinds) or (rates is not None and rates.gradients[:, p].any()):
                yield p

    def damping_of(self, vectors: Reals, at: Integers) -> tuple[Reals, Reals]:
        """QᵀĈQ and QᵀĤQ with modal damping, of the modes Q (r, m) at the positions `at` (m,)."""
        return _damping(self.modes.point, self.rates, vectors, at)

    def weighted(self, p: int, s: Complexes) -> Iterator[tuple[Complexes, Reals]]:
        """Factors (k,) and matrices (r, r) in the coordinates of the basis, whose sum is Z′ without modal damping."""
        point, one = self.modes.point, np.ones(len(s), complex)
        yield one, point.stiffness_derivatives[p]
        yield s**2, point.mass_derivatives[p]
        for weight, matrix in ((s, point.viscous_derivatives[p]), (1j * one, point.hysteretic_derivatives[p])):
            if np.any(matrix):
                yield weight, matrix

    def changes(self, p: int, s: Complexes) -> Iterator[tuple[Complexes, Reals]]:
        """The same in the modes (r, r), with modal damping."""
        projected = [(weight, self.vectors.T @ matrix @ self.vectors) for weight, matrix in self.weighted(p, s)]
        yield from projected
        if self.rates is not None:
            # zero between modes of which none is damped
            rows = self.damping_change(p, projected[0][1][: self.near], projected[1][1][: self.near])
            whole = np.zeros_like(projected[0][1])
            whole[: self.near], whole[:, : self.near] = rows, rows.T
            yield self.damping_weight(s), whole

    def damping_weight(self, s: Complexes) -> Complexes:
        """(k,) factor of modal damping."""
        assert self.rates is not None
        return np.full(len(s), 1j) if self.rates.hysteretic else s

    def damping_inside(self, at: Integers, p: int, stiffness: Reals, mass: Reals) -> Reals:
        """(m, m) block of the derivative of modal damping of the modes at the positions `at`, from those of K̂′, M̂′."""
        assert self.rates is not None
        damped = np.flatnonzero(at < len(self.rates.rates))
        d, slope = np.zeros((2, len(at)))
        d[damped], slope[damped] = self.rates.rates[at[damped]], self.rates.slopes[at[damped]]
        values = self.modes.eigenvalues[at]
        inside = divided(values, d, slope) * stiffness - divided(values, d * values, d + slope * values) * mass
        inside = inside + mass * d + d[:, None] * mass
        inside[damped, damped] += self.rates.gradients[at[damped], p]
        return np.asarray(inside)

    def damping_change(self, p: int, stiffness: Reals, mass: Reals) -> Reals:
        """(near, r) rows of the derivative of modal damping from those of K̂′ and M̂′."""
        assert self.rates is not None
        d = np.append(self.rates.rates, np.zeros(self.near - len(self.rates.rates)))
        values, theta = self.modes.eigenvalues[: self.near], self.modes.theta[self.near :]
        inside = self.damping_inside(np.arange(self.near), p, stiffness[:, : self.near], mass[:, : self.near])
        # 1/(λ_i − λ_j) for the others, which nothing damps, and −λ_j/(λ_i − λ_j); 1/λ_j may be zero
        below = np.outer(values - self.modes.point.model.shift, theta) - 1.0
        by_stiffness, by_mass = theta / below, -(1.0 + self.modes.point.model.shift * theta) / below
        outside = d[:, None] * (by_stiffness * stiffness[:, self.near :] + by_mass * mass[:, self.near :])
        return np.hstack([inside, outside])


def _damping(point: ReducedPoint, rates: ModalRates | None, vectors: Reals, at: Integers) -> tuple[Reals, Reals]:
    """Viscous and hysteretic damping in some vectors, the modes at the positions `at`."""
    viscous, hysteretic = (_in_modes(matrix, vectors) for matrix in (point.viscous, point.hysteretic))
    if rates is None:
        return viscous, hysteretic
    damped, added = np.flatnonzero(at < len(rates.rates)), np.zeros(len(at))
    added[damped] = rates.rates[at[damped]]
    if rates.hysteretic:
        return viscous, _with_diagonal(hysteretic, added)
    return _with_diagonal(viscous, added), hysteretic


def _in_modes(matrix: Reals, vectors: Reals) -> Reals:
    """VᵀAV (m, m) for vectors (r, m), or its diagonal (m,) where it has no other entries."""
    return slim(vectors.T @ matrix @ vectors) if np.any(matrix) else np.zeros(vectors.shape[1])


def _with_diagonal(matrix: Reals, added: Reals) -> Reals:
    """The sum of a matrix, or of its diagonal where it is one, with a diagonal."""
    return matrix + added if matrix.ndim == 1 else slim(matrix + np.diag(added))


def _split(system: _System, s: Complexes, count: int) -> FunctionsInBasis:
    """Where Z is diagonal: near modes at every line, the others at the nodes."""
    of, n = system.stiffness, system.near
    nodes, turn = _nodes(s)
    x, y = (_responses(of.diagonal(s)[:, :n], f[:n]) for f in (of.inputs, of.outputs.T))
    far = of.diagonal(nodes)[:, n:]
    # undamped ones respond in phase: half the work
    far = far if far.imag.any() else far.real
    far_x, far_y = (_responses(far, f[n:]) for f in (of.inputs, of.outputs.T))
    values = of.outputs[:, :n] @ x + _interpolated(turn, of.outputs[:, n:] @ far_x)
    y, far_y = np.swapaxes(y, 1, 2), np.swapaxes(far_y, 1, 2)
    gradient = np.zeros((*values.shape, count), complex)
    k, a, b = values.shape
    q, r = len(nodes), len(system.vectors)
    moved = np.moveaxis(system.vectors[:, n:] @ far_x, 0, 1).reshape(r, q * b)
    driven, far_driven = np.moveaxis(x, 0, 1).reshape(n, k * b), np.moveaxis(far_x, 0, 1).reshape(r - n, q * b)
    far_seen = np.ascontiguousarray(far_y.reshape(q * a, r - n).T)
    left = far_y @ system.vectors[:, n:].T
    for p in system.acting(count):
        at_lines = np.zeros((n, k, b), complex)
        coupled, back, rest = np.zeros((n, q, b), complex), np.zeros((q, a, n), complex), np.zeros((q, a, b), complex)
        rows = []
        for (weight, matrix), (at, _) in zip(system.weighted(p, s), system.weighted(p, nodes)):
            rows.append((weight, at, (matrix @ system.vectors[:, :n]).T @ system.vectors))
            forces = _times(matrix, moved).reshape(r, q, b)
            rest += at[:, None, None] * (left @ np.moveaxis(forces, 1, 0))
        if system.rates is not None:
            change = system.damping_change(p, rows[0][2], rows[1][2])
            rows.append((system.damping_weight(s), system.damping_weight(nodes), change))
        for weight, at, row in rows:
            at_lines += weight[:, None] * _times(row[:, :n], driven).reshape(n, k, b)
            coupled += at[:, None] * _times(row[:, n:], far_driven).reshape(n, q, b)
            back += at[:, None, None] * _times(row[:, n:], far_seen).T.reshape(q, a, n)
        coupling = _interpolated(turn, np.moveaxis(coupled, 1, 0))
        total = y @ (np.moveaxis(at_lines, 1, 0) + coupling) + _interpolated(turn, back) @ x
        gradient[..., p] = -total - _interpolated(turn, rest)
    return FunctionsInBasis(np.asarray(values), gradient)


def _responses(Z: Complexes, forces: Reals) -> Complexes:
    """(k, r, b) responses of a diagonal Z (k, r) to forces (r, b); NaN on an undamped resonance."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(Z == 0.0, np.nan, 1.0 / Z)
    return np.asarray(inverse[:, :, None] * forces)


def _times(matrix: Reals, columns: Complexes) -> Complexes:
    """A real matrix times real or complex columns, in real products."""
    if not np.iscomplexobj(columns):
        return np.asarray(matrix @ columns)
    pair = np.ascontiguousarray(columns).view(float)
    return np.ascontiguousarray(matrix @ pair).view(complex)


def _nodes(s: Complexes) -> tuple[Complexes, Reals]:
    """Chebyshev points (q,) over the lines, and the matrix (k, q) that interpolates; the lines where they are few.

    Source: J.-P. Berrut, L. N. Trefethen, SIAM Review 46 (2004), barycentric formula for points of the first kind.
    """
    if len(s) <= _CHEBYSHEV_POINTS:
        return s, np.eye(len(s))
    decay, low, high = s.real[0], s.imag.min(), s.imag.max()
    angle = (2.0 * np.arange(_CHEBYSHEV_POINTS) + 1.0) * np.pi / (2.0 * _CHEBYSHEV_POINTS)
    nodes = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angle)
    gap = s.imag[:, None] - nodes
    hit = gap == 0.0
    weights = (-1.0) ** np.arange(_CHEBYSHEV_POINTS) * np.sin(angle) / np.where(hit, 1.0, gap)
    turn = weights / weights.sum(axis=1, keepdims=True)
    met = hit.any(axis=1)
    turn[met] = hit[met]
    return decay + 1j * nodes, turn


def _interpolated(turn: Reals, values: Complexes) -> Complexes:
    """(k, …) from values (q, …) at the nodes."""
    flat = values.reshape(len(values), int(np.prod(values.shape[1:])))
    return _times(turn, flat).reshape(len(turn), *values.shape[1:])
