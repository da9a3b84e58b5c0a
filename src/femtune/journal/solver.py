"""The solver of a run: full-model solutions from the journal, or solved and kept there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune import __version__
from femtune.errors import Notice
from femtune.journal.entry import Entry
from femtune.journal.journal import SCHEMA, Form
from femtune.model import EigenSolution, SubspaceDerivative, derivatives_digest, digest, matrices_digest
from femtune.model.full_model import direct

if TYPE_CHECKING:
    from femtune.journal.journal import Journal
    from femtune.model import ModelPoint
    from femtune.model.full_model import ModelSolver

_DERIVATIVE_FIELDS = ("eigenvalues", "stiffness", "mass", "outside", "shapes")
"""Arrays of a `SubspaceDerivative`, in the order of its fields."""


@dataclass(frozen=True, eq=False)
class JournaledSolver:
    """Solver that looks up solutions first. Keys are digests of the matrices, so that every change of these is a new
    key."""

    journal: Journal
    solver: ModelSolver = direct
    _digests: WeakKeyDictionary[EigenSolution, str] = field(default_factory=WeakKeyDictionary)

    def __reduce__(self) -> tuple[Any, ...]:
        """Without the journal in another process: it belongs to this process."""
        return _without_journal, (self.solver,)

    def modes(
        self, point: ModelPoint, count: int | None, max_hz: float | None, start: EigenSolution | None = None
    ) -> EigenSolution:
        """As `solve_modes`: by K, M and how many modes are wanted, wherever the iteration starts."""
        key = _key("modes", matrices_digest(point, "stiffness", "mass"), count, max_hz)
        form, begun = Form("modes", _of_modes, partial(_modes, point)), () if start is None else (start,)
        return self.journal.obtain(form, key, partial(self.solver.modes, point, count, max_hz, *begun))

    def improved(self, start: EigenSolution, steps: int) -> EigenSolution:
        """As `improved_modes`: by K, M and the vectors that it begins with."""
        point = start.point
        vectors = digest(start.eigenvalues, start.shapes, start.shift, start.wanted, steps)
        key = _key("improved", matrices_digest(point, "stiffness", "mass"), vectors)
        form = Form("modes", _of_modes, partial(_modes, point))
        return self.journal.obtain(form, key, partial(self.solver.improved, start, steps))

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """As `subspace_derivative`: by the solution, the derivatives of the matrices, the modes and the rows."""
        key = _key("derivative", self._digest(solution), np.array(members), rows)
        shape = (solution.point.n_parameters, len(members), rows.shape[0])
        form = Form("derivative", _of_derivative, partial(_derivative, shape))
        return self.journal.obtain(form, key, partial(self.solver.derivative, solution, members, rows))

    def _digest(self, solution: EigenSolution) -> str:
        if solution not in self._digests:
            self._digests[solution] = digest(
                matrices_digest(solution.point, "stiffness", "mass"),
                derivatives_digest(solution.point),
                solution.eigenvalues,
                solution.shapes,
                solution.shift,
            )
        return self._digests[solution]


def _without_journal(solver: ModelSolver) -> ModelSolver:
    return solver


def _key(*parts: Any) -> str:
    return digest(__version__, SCHEMA, *parts)


def _of_modes(solution: EigenSolution) -> Entry:
    facts = {name: getattr(solution, name) for name in ("wanted", "shift", "sturm_shift", "sturm_count")}
    numbers = {name: value.item() if isinstance(value, np.generic) else value for name, value in facts.items()}
    notices = [[n.code, n.what, n.level] for n in solution.notices]
    arrays = {"eigenvalues": solution.eigenvalues, "shapes": solution.shapes}
    return Entry(arrays, {**numbers, "notices": notices, "method": solution.method})


def _modes(point: ModelPoint, entry: Entry) -> EigenSolution:
    values = _floats(entry, "eigenvalues", (entry.arrays["eigenvalues"].size,))
    shapes = _floats(entry, "shapes", (point.configured.n_free, len(values)))
    wanted, counted = _whole(entry, "wanted", 1, len(values)), _whole(entry, "sturm_count", -1, 2**63)
    shift = _number(entry, "shift")
    if (np.diff(values) < 0.0).any() or not shift < values[0]:
        raise ValueError("its eigenvalues are not in their order")
    check_pairs(point, values, shapes)
    notices = tuple(_notice(*n) for n in entry.facts["notices"])
    cut, method = _number(entry, "sturm_shift"), entry.facts.get("method", "")
    if not isinstance(method, str):
        raise ValueError("its method is no text")
    return EigenSolution(point, values, shapes, wanted, shift, cut, counted, notices, method=method)


_TOLERANCE = 1e-5
"""Relative error of recalled modes in the equation of motion and in orthogonality. It is well above that of any
eigen-solver, and well below that of modes of other matrices."""
_STIFFNESS_ROUNDING = 1e-12
"""Rounding of φᵀKφ relative to the largest diagonal term of K; it is large beside eigenvalues near zero."""


def check_pairs(point: ModelPoint, values: NDArray[np.float64], shapes: NDArray[np.float64]) -> None:
    """Check that the recalled pairs are modes of these matrices: ΦᵀKΦ = Λ, ΦᵀMΦ = 1, and Kφ = λMφ.

    The first two reveal wrong eigenvalues and scales, the last one wrong shapes.
    """
    elastic, inertial = point.stiffness @ shapes, point.mass @ shapes
    largest = float(np.abs(point.stiffness.diagonal()).max(initial=0.0))
    lengths = np.linalg.norm(shapes, axis=0)
    rounding = _STIFFNESS_ROUNDING * largest * np.outer(lengths, lengths)
    size = np.sqrt(np.abs(np.outer(values, values)))
    energy = np.abs(shapes.T @ elastic - np.diag(values)) <= _TOLERANCE * size + rounding
    unit = np.abs(shapes.T @ inertial - np.eye(len(values))) <= _TOLERANCE
    rest = np.linalg.norm(elastic - inertial * values, axis=0) <= _TOLERANCE * largest * lengths
    if not (energy.all() and unit.all() and rest.all()):
        raise ValueError("its modes do not satisfy the equation of motion")


def _notice(code: object, what: object, level: object) -> Notice:
    if not (isinstance(code, str) and isinstance(what, str) and level in ("info", "warning")):
        raise ValueError("its notices are none")
    return Notice(code, what, level=str(level))


def _of_derivative(derivative: SubspaceDerivative) -> Entry:
    return Entry({name: getattr(derivative, name) for name in _DERIVATIVE_FIELDS}, {})


def _derivative(shape: tuple[int, int, int], entry: Entry) -> SubspaceDerivative:
    k, c, rows = shape
    shapes = ((c,), (k, c, c), (k, c, c), (rows, c, k), (rows, c))
    values, stiffness, mass, outside, mode_shapes = (
        _floats(entry, name, s) for name, s in zip(_DERIVATIVE_FIELDS, shapes)
    )
    return SubspaceDerivative(values, stiffness, mass, outside, mode_shapes)


def _floats(entry: Entry, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    array = entry.arrays[name]
    if array.dtype != np.dtype(np.float64) or array.shape != shape:
        raise ValueError(f"{name} is {array.dtype}{list(array.shape)} instead of float64{list(shape)}")
    return array


def _whole(entry: Entry, name: str, least: int, most: int) -> int:
    value = entry.facts[name]
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise ValueError(f"{name} is out of its range")
    return value


def _number(entry: Entry, name: str) -> float:
    value = entry.facts[name]
    if not isinstance(value, float) or not np.isfinite(value):
        raise ValueError(f"{name} is no number")
    return value
