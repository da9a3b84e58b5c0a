"""Whole fields of derivatives, one parameter at a time: nothing of the size of all of them is ever kept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.model.derivatives.modes import SubspaceDerivative, inverse_gaps, outside
from femtune.model.eigen.pencil import pieces
from femtune.model.eigen.solution import EigenSolution
from femtune.model.products import derivative_product


def derivatives_by_parameter(
    solution: EigenSolution, clusters: Sequence[Sequence[int]], rows: sp.csr_array | None = None
) -> Iterator[list[SubspaceDerivative]]:
    """Derivatives of the subspaces of several clusters by one parameter after the other, exact to rounding.

    Each step gives one `SubspaceDerivative` of one parameter (k = 1) for each cluster. It takes a block solve for all
    modes in each of some ten to forty iterations, and memory for a dozen fields of sixteen modes.

    Parameters
    ----------
    clusters : positions of the modes of each cluster in the solution
    rows : C (rows, n_free), the combinations of DOFs that are wanted; None for all free DOFs

    Raises
    ------
    FemtuneError : ``derivative.not-converged``
    """
    gaps = inverse_gaps(solution, clusters)
    members = [j for cluster in clusters for j in cluster]
    for i in range(solution.point.n_parameters):
        columns = [_columns(solution, i, members[some], gaps[:, some], rows) for some in pieces(0, len(members))]
        stiffness, mass, fields = (np.concatenate(parts, axis=1) for parts in zip(*columns))
        yield _by_cluster(solution, clusters, rows, (stiffness, mass, fields))


def _columns(
    solution: EigenSolution, i: int, members: list[int], gaps: Reals, rows: sp.csr_array | None
) -> tuple[Reals, Reals, Reals]:
    """ΦᵀK′φ_j and ΦᵀM′φ_j of all known modes (m, c), and the part of φ_j′ outside the clusters (rows, c)."""
    phi, values = solution.shapes, solution.eigenvalues[members]
    shapes = np.ascontiguousarray(phi[:, members])
    force, mass = (derivative_product(solution.point, kind, i, shapes) for kind in ("stiffness", "mass"))
    inner = phi.T @ force, phi.T @ mass
    force -= mass * values
    field = outside(solution, values, gaps, force)
    return *inner, field if rows is None else np.asarray(rows @ field)


def _by_cluster(
    solution: EigenSolution,
    clusters: Sequence[Sequence[int]],
    rows: sp.csr_array | None,
    parts: tuple[Reals, Reals, Reals],
) -> list[SubspaceDerivative]:
    out, at = [], 0
    for cluster in map(list, clusters):
        some = slice(at, at + len(cluster))
        stiffness, mass, field = (part[:, some] for part in parts)
        members = solution.shapes[:, cluster]
        shapes = members if rows is None else np.asarray(rows @ members)
        inner = stiffness[None, cluster], mass[None, cluster]
        out.append(SubspaceDerivative(solution.eigenvalues[cluster], *inner, field[:, :, None], shapes, 0.0))
        at += len(cluster)
    return out
