"""Memory of factors where the solver itself tells nothing beforehand."""

from __future__ import annotations

import numpy as np

from femtune.errors import FemtuneError
from femtune.model.memory import GIB, free_memory, require_memory
from femtune.model.symmetric import SymmetricMatrix

MEMORY_HINT = (
    "close other programs, take fewer DOFs, or share the eigenproblem among machines: --eigensolver slepc "
    "(docs/guide/solvers.md)"
)
_BYTES = 5.0


def least_bytes(matrix: SymmetricMatrix, triangles: int) -> int:
    """A rough lower bound of the memory of factors: 5 bytes · entries · log₂ n for each triangle that is kept.

    Nested dissection of a surface leaves about entries · log₂ n numbers (George, SIAM J. Numer. Anal. 10, 1973). The
    factor .6 was measured on shells of 15,000 to 560,000 DOF; solids take two to five times more.
    """
    n = max(matrix.shape[0], 2)
    size = 2.0 if np.iscomplexobj(matrix.data) else 1.0
    return int(_BYTES * size * triangles * len(matrix.indices) * np.log2(n))


def require_for_factors(matrix: SymmetricMatrix, factor_bytes: int) -> None:
    """Refuse a factorisation whose factors have no room.

    Raises
    ------
    FemtuneError : ``model.memory``
    """
    require_memory(factor_bytes, f"factorising {matrix.shape[0]:,} equations", MEMORY_HINT)


def ran_out(equations: int, needed_bytes: int, what: str = "factorised") -> FemtuneError:
    """The error for work on a number of equations that was started and had no room."""
    free = free_memory()
    return FemtuneError(
        "model.memory",
        f"memory ran out while {equations:,} equations were {what}; at least {needed_bytes / GIB:.2g} GiB are needed",
        values={"needed_bytes": needed_bytes, **({} if free is None else {"free_bytes": free})},
        hint=MEMORY_HINT,
    )
