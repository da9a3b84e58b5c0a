"""Modes at the sensors without derivatives, for points of which only the residuals are wanted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from femtune.model import EigenSolution, SubspaceDerivative


def seen_only(solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
    """What `subspace_derivative` gives of a model without parameters: eigenvalues and shapes at the rows."""
    members = list(members)
    shapes = np.asarray(rows @ solution.shapes[:, members])
    none = np.zeros((0, len(members), len(members)))
    return SubspaceDerivative(solution.eigenvalues[members], none, none, np.zeros((*shapes.shape, 0)), shapes, 0.0)
