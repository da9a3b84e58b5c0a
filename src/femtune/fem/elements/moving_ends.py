"""Bars of constant section whose length and direction are functions of their end offsets.

Every part of the element is c(L) g gᵀ, where g = Σ_c q_c(L) e_c are a force and a moment at each end along the moving
axes e_c, carried to the grid points by statics: the moment about a point is M + w × F. Bending shapes are q₀ + L q₁;
bending flexibilities are proportional to L³, those of shear and masses to L. So everything follows from the element of
unit length, differentiated exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Contribution, times
from femtune.fem.elements import placement
from femtune.fem.elements.bar import shear_flexible, skewed
from femtune.fem.elements.bending import PLANES, bending_modes
from femtune.fem.elements.line_mass import LUMPED, TWIST, consistent_matrix, lumped_matrix
from femtune.fem.fields import MatrixKind
from femtune.fem.rules import makes_rules
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters import jet
from femtune.parameters.jet import Jet

Rows = NDArray[np.int64]
Values = Mapping[str, Jet]
Vector = Sequence[Jet]

OFFSETS = ("W1A", "W2A", "W3A", "W1B", "W2B", "W3B")
# rows of the rotations due to bending, whose shapes are proportional to the length
_BENDING_ROTATIONS = (4, 5, 10, 11)
# rows and columns of the entries of a symmetric matrix
_UPPER = np.triu_indices(12)


@dataclass(frozen=True, eq=False)
class _Form:
    """c(values, length)·g gᵀ; `shape` (12,) on the displacements of the ends of an element of unit length."""

    shape: Reals
    coefficient: Callable[[Values, Jet], Jet]

    def at(self, row: int, length: Jet) -> Jet | float:
        """Entry of the shape at the length."""
        return length * self.shape[row] if row in _BENDING_ROTATIONS else float(self.shape[row])


def moving_axis(batch: ElementBatch, structure: Structure, spans: Reals) -> list[Contribution]:
    """Stiffness and mass of bars whose offsets are parameters, one contribution for each entry of the matrices.

    Parameters
    ----------
    spans : (e, 3) vectors from end to end at the deck's values, to check the length and axes of each element

    Raises
    ------
    FemtuneError : ``element.zero-length``, ``element.orientation``
    """
    x, _ = placement.line_axes(batch, np.zeros_like(spans), spans)
    placement.oriented_axes(batch, x, batch.facts["orientation"])
    flags = np.column_stack([batch.facts["pins"], *(shear_flexible(batch, structure, p) for p in PLANES)])
    out: list[Contribution] = []
    for pattern in np.unique(flags, axis=0):
        at = np.flatnonzero((flags == pattern).all(axis=1))
        geometry = _Geometry.of(batch, structure, at)
        shear = {p: bool(pattern[11 + p]) for p in PLANES}
        roles = ("E", "G", "A", "J", "I1", "I2", *(f"K{p}" for p in PLANES if shear[p]))
        out += _entries("stiffness", at, roles, _Matrix(geometry, tuple(_stiffness(pattern[:12], shear))))
        out += _entries("mass", at, _mass_roles(batch), _Matrix(geometry, tuple(_mass(batch, structure))))
    return out


def _stiffness(pins: NDArray, shear: Mapping[int, bool]) -> Iterator[_Form]:
    for row, stiffness in ((0, ("E", "A")), (3, ("G", "J"))):
        if not (pins[row] or pins[row + 6]):
            yield _Form(np.eye(12)[row + 6] - np.eye(12)[row], _over_length(*stiffness))
    for p, (rows, signs) in PLANES.items():
        for mode in bending_modes(np.ones(1), pins[rows][None].astype(bool)):
            shape = np.zeros(12)
            shape[rows] = mode.shape[0] * signs
            sheared = float(mode.shear[0]) if shear[p] else 0.0
            yield _Form(shape, _bent(p, float(mode.bending[0]), sheared))


@makes_rules
def _over_length(modulus: str, section: str) -> Callable[[Values, Jet], Jet]:
    return lambda values, length: values[modulus] * values[section] / length


@makes_rules
def _bent(plane: int, bending: float, shear: float) -> Callable[[Values, Jet], Jet]:
    def stiffness(values: Values, length: Jet) -> Jet:
        EI = values["E"] * values[f"I{plane}"]
        if not shear:
            return EI / (bending * length**3)
        GA = values[f"K{plane}"] * values["A"] * values["G"]
        return 1.0 / (bending * length**3 / EI + shear * length / GA)

    return stiffness


def _mass_roles(batch: ElementBatch) -> tuple[str, ...]:
    return ("rho", "A", "NSM", *(("I1", "I2") if batch.card == "CBEAM" else ()))


def _mass(batch: ElementBatch, structure: Structure) -> Iterator[_Form]:
    """The eigenvectors of the mass matrix for unit length and density that have nonzero eigenvalues."""
    one, factor = np.ones(1), structure.mass_factor
    consistent = consistent_matrix(one, True, structure.lumped_along)[0]
    unit = consistent if structure.consistent_mass else lumped_matrix(one)[0]
    yield from _spectrum(unit, _translational(factor))
    if batch.card == "CBEAM":
        twist = np.zeros((12, 12))
        twist[np.ix_((3, 9), (3, 9))] = TWIST if structure.consistent_mass else LUMPED
        yield from _spectrum(twist, _rotational(factor))


@makes_rules
def _translational(factor: float) -> Callable[[Values, Jet], Jet]:
    return lambda v, length: (v["rho"] * v["A"] + v["NSM"]) * length * factor


@makes_rules
def _rotational(factor: float) -> Callable[[Values, Jet], Jet]:
    return lambda v, length: v["rho"] * (v["I1"] + v["I2"]) * length * factor


def _spectrum(matrix: Reals, coefficient: Callable[[Values, Jet], Jet]) -> Iterator[_Form]:
    weights, vectors = np.linalg.eigh(matrix)
    for weight, vector in zip(weights, vectors.T):
        if weight > 1e-12 * weights[-1]:
            yield _Form(np.where(np.abs(vector) > 1e-14, vector, 0.0) * np.sqrt(weight), coefficient)


@dataclass(frozen=True, eq=False)
class _Geometry:
    """Constant data of m elements: `base` (m, 3) from node to node, `v` (m, 3) orientation, and for each end the frames
    (m, 3, 3) of the node's displacements and of the offset's components.
    """

    base: Reals
    v: Reals
    nodes: tuple[Reals, Reals]
    arms: tuple[Reals, Reals]

    @staticmethod
    def of(batch: ElementBatch, structure: Structure, at: Rows) -> _Geometry:
        """The data of some elements of a batch."""
        a, b = (placement.node_positions(batch, structure, k)[at] for k in (0, 1))
        first, second = (placement.node_frames(batch, structure, k)[at] for k in (0, 1))
        arms = batch.facts["frame_a"][at], batch.facts["frame_b"][at]
        return _Geometry(b - a, batch.facts["orientation"][at], (first, second), arms)

    def rows(self, at: Rows) -> _Geometry:
        """The data of some of the elements, in any order."""
        nodes, arms = ((f[0][at], f[1][at]) for f in (self.nodes, self.arms))
        return _Geometry(self.base[at], self.v[at], nodes, arms)

    def placed(self, values: Values) -> tuple[Jet, list[Vector], list[Vector]]:
        """Length, the three axes, and both arms, all in the basic frame."""
        w = [[values[name] for name in OFFSETS[3 * k : 3 * k + 3]] for k in (0, 1)]
        arms: list[Vector] = [_turned(frame, offset) for frame, offset in zip(self.arms, w)]
        span = [b - a + self.base[:, i] for i, (a, b) in enumerate(zip(*arms))]
        length = _norm(span)
        x = [s / length for s in span]
        across = _cross(x, [x[0] * 0.0 + self.v[:, i] for i in range(3)])
        height = _norm(across)
        z = [s / height for s in across]
        return length, [x, _cross(z, x), z], arms


def _turned(frames: Reals, v: Vector) -> list[Jet]:
    """(m, 3, 3) frames times a vector."""
    if np.array_equal(frames, np.broadcast_to(np.eye(3), frames.shape)):
        return list(v)
    return [_sum([v[c] * frames[:, i, c] for c in range(3)]) for i in range(3)]


def _norm(v: Vector) -> Jet:
    return jet.sqrt(_sum([c * c for c in v]))


def _cross(a: Vector, b: Vector) -> list[Jet]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _sum(terms: Sequence[Jet]) -> Jet:
    out = terms[0]
    for term in terms[1:]:
        out = out + term
    return out


def _entries(kind: MatrixKind, at: Rows, roles: tuple[str, ...], matrix: _Matrix) -> Iterator[Contribution]:
    """The upper triangle, entry by entry; all entries share one function, which selects the entry by its facts."""
    for entry, (i, j) in enumerate(zip(*_UPPER)):
        unit = np.zeros((len(at), 12, 12))
        unit[:, i, j] = unit[:, j, i] = 1.0
        numbers = {"element": np.arange(len(at)), "entry": np.full(len(at), entry)}
        label = f"moving {kind} {i}-{j}"
        yield Contribution(kind, label, at, unit, (*roles, *OFFSETS), matrix.entry, numbers)


@dataclass(eq=False)
class _Matrix:
    """Σ c g gᵀ of elements; the last matrices without derivatives are cached, since every entry needs them."""

    geometry: _Geometry
    forms: tuple[_Form, ...]
    _kept: dict[bytes, Jet] = field(default_factory=dict, repr=False)

    def entry(self, values: Values, facts: Mapping[str, NDArray]) -> Jet:
        """(m,) entries with the facts "entry", counted row by row in the upper triangle, of the elements "element"."""
        table = np.column_stack([facts["element"], *(j.value for j in values.values())])
        _, first, again = np.unique(table, axis=0, return_index=True, return_inverse=True)
        inputs = {name: j[first] for name, j in values.items()}
        place = again.ravel(), facts["entry"]
        n, k = len(inputs), next(iter(inputs.values())).n_variables
        if k == 0:
            return self._known(table[first].tobytes(), inputs, facts["element"][first])[place]
        if k <= n:
            return self._whole(inputs, facts["element"][first])[place]
        whole = self._whole(dict(zip(inputs, _variables(list(inputs.values())))), facts["element"][first])[place]
        return _chained(whole, [j[place[0]] for j in inputs.values()])

    def _known(self, key: bytes, values: Values, elements: Rows) -> Jet:
        if key not in self._kept:
            self._kept = {key: self._whole(values, elements)}
        return self._kept[key]

    def _whole(self, values: Values, elements: Rows) -> Jet:
        """(m, 78) upper triangles."""
        geometry = self.geometry.rows(elements)
        length, axes, arms = geometry.placed(values)
        shapes = _beside([_on_nodes(form, length, axes, arms, geometry.nodes) for form in self.forms])
        weights = _beside([form.coefficient(values, length) for form in self.forms])
        return _products(weights[:, :, None] * shapes, shapes)[:, _UPPER[0], _UPPER[1]]


def _on_nodes(form: _Form, length: Jet, axes: list[Vector], arms: list[Vector], frames: tuple[Reals, Reals]) -> Jet:
    """(m, 12) a form's forces on the nodes, along their displacement frames."""
    parts: list[Jet] = []
    for k in (0, 1):
        force, moment = (_along(form, 6 * k + start, length, axes) for start in (0, 3))
        if form.shape[6 * k : 6 * k + 3].any():
            moment = [m + turn for m, turn in zip(moment, _cross(arms[k], force))]
        for vector in (force, moment):
            parts += _turned(np.swapaxes(frames[k], 1, 2), vector)
    return _beside(parts)


def _beside(jets: Sequence[Jet]) -> Jet:
    """Jets (m, …) stacked as one, (m, number, …)."""
    value, grad, hess = (np.stack([getattr(j, name) for j in jets], axis=1) for name in ("value", "grad", "hess"))
    return Jet(value, grad, hess)


def _products(a: Jet, b: Jet) -> Jet:
    """(m, 12, 12) sums Σ_r a_r b_rᵀ of jets (m, r, 12), by products of matrices."""
    m, r, d = a.value.shape
    n, h, left = a.n_variables, a.n_curved, np.swapaxes(a.value, 1, 2)
    slopes = np.moveaxis(a.grad, 1, 3).reshape(m, d * n, r)
    bending = np.moveaxis(a.bending, 1, 3).reshape(m, d * h, r)
    curves = np.moveaxis(a.hess, 1, 4).reshape(m, d * h * h, r)
    grad = (left @ b.grad.reshape(m, r, d * n)).reshape(m, d, d, n)
    grad = grad + np.swapaxes((slopes @ b.value).reshape(m, d, n, d), 2, 3)
    cross = np.swapaxes((bending @ b.bending.reshape(m, r, d * h)).reshape(m, d, h, d, h), 2, 3)
    hess = (left @ b.hess.reshape(m, r, d * h * h)).reshape(m, d, d, h, h) + cross + np.swapaxes(cross, 3, 4)
    hess = hess + np.moveaxis((curves @ b.value).reshape(m, d, h, h, d), 4, 2)
    return Jet(left @ b.value, grad, hess)


def _along(form: _Form, start: int, length: Jet, axes: list[Vector]) -> list[Jet]:
    """A vector of three entries of a form, in the basic frame."""
    entries = [(axes[c], form.at(start + c, length)) for c in range(3) if form.shape[start + c]]
    if not entries:
        return [0.0 * length] * 3
    return [_sum([axis[i] * entry for axis, entry in entries]) for i in range(3)]


def _variables(inputs: list[Jet]) -> list[Jet]:
    """Jets of the same values with themselves as the variables."""
    n = len(inputs)
    out = []
    for i, j in enumerate(inputs):
        grad = np.zeros((*j.value.shape, n), j.value.dtype)
        grad[..., i] = 1.0
        out.append(Jet(j.value, grad, np.zeros((*grad.shape, n), j.value.dtype)))
    return out


def _chained(outer: Jet, inputs: list[Jet]) -> Jet:
    """Chain rule: a jet (m,) in n inputs as a jet in the variables of the inputs."""
    grad, hess = (np.stack([getattr(j, name) for j in inputs], axis=1) for name in ("grad", "hess"))
    curve = np.einsum("mn,mnkl->mkl", outer.grad, hess)
    bending = np.stack([j.bending for j in inputs], axis=1)
    bent = np.swapaxes(bending, 1, 2) @ outer.hess @ bending
    return Jet(outer.value, np.einsum("mn,mnk->mk", outer.grad, grad), curve + bent)


# ----------------------------------------------------------------------------------------------------
# Bars and beams whose end offsets are parameters: matrices as functions of W1A … W3B.
#
# A rigid arm w carries the motion of its grid point to the end of the beam, u + θ × w, so that K = T(w)ᵀ K_end T(w)
# with T = 1 + Σ w_i X_i. If the axis only shifts, K_end is constant and K is a quadratic polynomial: (1, a, a²) for one
# offset. If length or direction change, see `moving_axis`. Rigid-body motion is strain-free for any offsets. Source:
# Mottershead, Friswell, Ng and Brandon (1996), Mechanical Systems and Signal Processing 10(2), 171-182.


Kernel = Callable[[ElementBatch, Structure], list[Contribution]]

COMPONENTS = {"A": ("W1A", "W2A", "W3A"), "B": ("W1B", "W2B", "W3B")}
"""Fields of the offsets at both ends."""


def has_offsets(batch: ElementBatch) -> bool:
    """True for a batch whose offsets are parameters."""
    return "W1A" in batch.roles


def may_turn(batch: ElementBatch, structure: Structure) -> NDArray[np.bool_]:
    """(e,) True for the elements whose axis may move: bars of constant section that are not skew."""
    if batch.kind != "bar":
        return np.zeros(len(batch), bool)
    return ~skewed(batch, structure)


def arms(batch: ElementBatch, end: str, table: NDArray) -> NDArray:
    """(e, 3) offsets of an end in the basic frame, of a value table (n,)."""
    w = np.stack([table[batch.roles[name]] for name in COMPONENTS[end]], axis=1)
    return np.einsum("eic,ec->ei", batch.facts[f"frame_{end.lower()}"], w)


def spans(batch: ElementBatch, structure: Structure, table: NDArray) -> NDArray:
    """(e, 3) vectors from end A to end B."""
    a, b = (placement.node_positions(batch, structure, k) + arms(batch, end, table) for k, end in enumerate("AB"))
    return np.asarray(b - a)


def with_moved_ends(kernel: Kernel, batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Contributions of a batch whose offsets are parameters; `kernel` is that of its kind."""
    if "still" in batch.facts or not may_turn(batch, structure).all():
        return list(_polynomial(kernel, batch, structure))
    return moving_axis(batch, structure, spans(batch, structure, structure.values.values))


def _polynomial(kernel: Kernel, batch: ElementBatch, structure: Structure) -> Iterator[Contribution]:
    """Each part A of the beam between its ends as A + Σ w_i (A X_i + X_iᵀ A) + Σ w_i w_j X_iᵀ A X_j."""
    turns = _turns(batch, structure)
    between = replace(batch, facts={**batch.facts, "at_ends": np.ones(len(batch), bool)})
    for part in kernel(between, structure):
        yield part
        X = {name: turn[part.at] for name, turn in turns.items()}
        for name, turn in X.items():
            once = part.matrices @ turn
            yield from _power(part, once + np.swapaxes(once, 1, 2), name)
        for i, j in combinations_with_replacement(X, 2):
            twice = np.swapaxes(X[i], 1, 2) @ part.matrices @ X[j]
            both = 0.5 * (twice + np.swapaxes(twice, 1, 2))
            yield from _power(part, both if i == j else 2.0 * both, i, j)


def _power(part: Contribution, matrices: Reals, *names: str) -> Iterator[Contribution]:
    if matrices.any():
        yield times(replace(part, stored=matrices, label=f"{part.label}-{'-'.join(names)}"), *names)


def _turns(batch: ElementBatch, structure: Structure) -> dict[str, Reals]:
    """(e, 12, 12) displacements of the ends due to a unit of each offset, in the frames of the nodes."""
    out = {}
    for k, end in enumerate("AB"):
        nodes, frame = placement.node_frames(batch, structure, k), batch.facts[f"frame_{end.lower()}"]
        for c, name in enumerate(COMPONENTS[end]):
            arm = np.einsum("eji,ej->ei", nodes, frame[:, :, c])
            turn = np.zeros((len(batch), 12, 12))
            turn[:, 6 * k : 6 * k + 3, 6 * k + 3 : 6 * k + 6] = -placement.cross_matrix(arm)
            out[name] = turn
    return out
