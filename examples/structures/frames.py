"""Small structures written by hand, and their modes by dense linear algebra: for tests against closed forms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from femtune.arrays import Reals
from femtune.fem.assemble import assemble
from femtune.fem.elimination import eliminate
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ConstraintRows, ElementBatch, NodeTable, Structure, no_constraints
from femtune.fem.values import ValueTableBuilder

# principal mass, after every DOF is scaled by its own, below which a direction counts as massless
MASSLESS = 1e-12


@dataclass(frozen=True)
class Part:
    """Elements of one kind: `connection` (e, k) rows of the nodes, or DOFs for scalar elements; −1 is ground.

    `values` holds one number, or one an element, for each role.
    """

    kind: str
    card: str
    connection: NDArray[np.int64]
    values: Mapping[str, ArrayLike]
    facts: Mapping[str, NDArray] = field(default_factory=dict)


def bars(
    connection: ArrayLike,
    values: Mapping[str, ArrayLike],
    card: str = "CBAR",
    orientation: ArrayLike = (0.0, 1.0, 0.0),
    offsets: tuple[ArrayLike, ArrayLike] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    pins: Sequence[int] = (),
) -> Part:
    """Bars or beams; `pins` are released DOFs of every element, 0 to 5 at end A and 6 to 11 at end B."""
    at = np.array(connection)
    released = np.isin(np.arange(12), pins)
    facts = {
        "orientation": _each(orientation, len(at)),
        "offset_a": _each(offsets[0], len(at)),
        "offset_b": _each(offsets[1], len(at)),
        "pins": np.tile(released, (len(at), 1)),
    }
    return Part("bar", card, at, {"I12": 0.0, "K1": 0.0, "K2": 0.0, "NSM": 0.0, **values}, facts)


def rods(connection: ArrayLike, values: Mapping[str, ArrayLike]) -> Part:
    """Rods."""
    return Part("rod", "CROD", np.array(connection), {"NSM": 0.0, **values})


def bushes(connection: ArrayLike, values: Mapping[str, ArrayLike], **facts: ArrayLike) -> Part:
    """Bushes along the basic axes without arms, unless `frame`, `arm_a` or `arm_b` is given for all of them."""
    at = np.array(connection)
    default: dict[str, ArrayLike] = {"frame": np.eye(3), "arm_a": np.zeros(3), "arm_b": np.zeros(3)}
    given = {name: _each(fact, len(at)) for name, fact in {**default, **facts}.items()}
    return Part("bush", "CBUSH", at, {f"K{i}": 0.0 for i in range(1, 7)} | dict(values), given)


def masses(nodes: Sequence[int], values: Mapping[str, ArrayLike], offset: ArrayLike = (0.0, 0.0, 0.0)) -> Part:
    """Concentrated masses along the basic axes."""
    at = np.array(nodes)[:, None]
    zero = {f"I{i}{j}": 0.0 for i in (1, 2, 3) for j in range(1, i + 1)}
    facts = {"offset": _each(offset, len(at)), "frame": _each(np.eye(3), len(at))}
    return Part("concentrated-mass", "CONM2", at, zero | dict(values), facts)


def scalars(kind: str, dofs: ArrayLike, role: str, value: ArrayLike) -> Part:
    """Springs ("spring", "K"), masses ("scalar-mass", "M") or dashpots ("dashpot", "B"); DOFs, −1 for ground."""
    card = {"spring": "CELAS2", "scalar-mass": "CMASS2", "dashpot": "CDAMP2"}[kind]
    return Part(kind, card, np.array(dofs), {role: value})


def _each(fact: ArrayLike, count: int) -> NDArray:
    one = np.array(fact, float)
    return np.tile(one, (count,) + (1,) * one.ndim)


def make_structure(xyz: ArrayLike, parts: Iterable[Part], frames: NDArray | None = None, **settings: Any) -> Structure:
    """A structure of grid points 1, 2, … at `xyz` (n, 3) with displacement frames (n, 3, 3).

    Every element has values of its own. `settings` are further fields of Structure.
    """
    points = np.array(xyz, float)
    n = len(points)
    basic = np.tile(np.eye(3), (n, 1, 1))
    nodes = NodeTable(np.arange(1, n + 1), points, basic if frames is None else frames)
    table = ValueTableBuilder()
    batches = tuple(part_batch(i, part, table) for i, part in enumerate(parts))
    return Structure(nodes, table.table(), batches, **settings)


def part_batch(i: int, part: Part, table: ValueTableBuilder) -> ElementBatch:
    """The elements of the i-th part, their values put into the table."""
    at, e = part.connection, len(part.connection)
    ids = 1000 * i + 1 + np.arange(e)
    roles = {
        name: np.array([table.add(FieldRef(part.card, int(k), name), x) for k, x in zip(ids, _spread(value, e))])
        for name, value in part.values.items()
    }
    if part.kind in ("spring", "scalar-mass", "dashpot"):
        return ElementBatch(part.kind, part.card, ids, np.where(at >= 0, at // 6, -1), at, roles)
    dofs = np.where(at[:, :, None] >= 0, 6 * at[:, :, None] + np.arange(6), -1).reshape(e, -1)
    return ElementBatch(part.kind, part.card, ids, at, dofs, roles, part.facts)


def _spread(value: ArrayLike, e: int) -> list[float]:
    return [float(x) for x in np.broadcast_to(np.asarray(value, float), (e,))]


def dense_matrices(
    structure: Structure, held: Iterable[int] = (), rows: ConstraintRows | None = None
) -> tuple[Reals, Reals]:
    """Stiffness and mass on the free DOFs of a small structure, both dense."""
    nodes = structure.nodes
    T = eliminate(nodes.n_dofs, no_constraints() if rows is None else rows, held, nodes.describe).T.toarray()
    K, M = (assemble(structure, kind).toarray() for kind in ("stiffness", "mass"))
    return T.T @ K @ T, T.T @ M @ T


def dense_modes(structure: Structure, held: Iterable[int] = (), rows: ConstraintRows | None = None) -> Reals:
    """Natural frequencies in Hz, ascending, of a small structure; directions without mass are condensed.

    DOFs that have neither stiffness nor mass are left out; negative eigenvalues (rounding) count as zero.
    """
    K, M = dense_matrices(structure, held, rows)
    used = (np.abs(K).sum(axis=1) > 0.0) | (np.abs(M).sum(axis=1) > 0.0)
    inertia, k = _principal(K[np.ix_(used, used)], M[np.ix_(used, used)])
    light = inertia <= MASSLESS
    heavy = ~light
    condensed = k[np.ix_(heavy, heavy)]
    if light.any():
        rest = np.linalg.solve(k[np.ix_(light, light)], k[np.ix_(light, heavy)])
        condensed = condensed - k[np.ix_(heavy, light)] @ rest
    scale = 1.0 / np.sqrt(inertia[heavy])
    eigenvalues = scipy.linalg.eigvalsh(scale[:, None] * condensed * scale)
    return np.asarray(np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi))


def _principal(K: Reals, M: Reals) -> tuple[Reals, Reals]:
    """Principal masses, each DOF scaled by its own, and the stiffness along their directions."""
    own = np.sqrt(np.diag(M))
    scale = 1.0 / np.where(own > 0.0, own, 1.0)
    inertia, directions = np.linalg.eigh(scale[:, None] * M * scale)
    return inertia, directions.T @ (scale[:, None] * K * scale) @ directions
