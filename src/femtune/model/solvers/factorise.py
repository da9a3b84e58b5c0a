"""Factorisation of sparse symmetric matrices, real (with inertia) or complex, behind one small interface."""

from __future__ import annotations

import hashlib
import os
from collections import OrderedDict
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import scipy.sparse as sp

from femtune.errors import FemtuneError, did_you_mean
from femtune.model.linear.symmetric import SymmetricMatrix, symmetric
from femtune.model.solvers import cholmod, mumps, pardiso, rslab
from femtune.model.solvers.cholmod import CholmodAnalysis
from femtune.model.solvers.interface import Analysis, Factor, SingularMatrixError
from femtune.model.solvers.mumps import MumpsAnalysis
from femtune.model.solvers.pardiso import PardisoAnalysis
from femtune.model.solvers.rslab import RslabAnalysis
from femtune.model.solvers.small import DENSE_UP_TO, DenseAnalysis
from femtune.model.solvers.superlu import SuperLuAnalysis

__all__ = ["Analysis", "Factor", "SingularMatrixError", "analyse", "available_solvers", "factorise", "solver_asked"]

PARDISO_FROM = 3000
"""Equations of a real matrix below which starting the threaded library costs more than it saves."""
PARDISO_FROM_COMPLEX = 300
"""The same for a complex matrix: SuperLU's complex kernels are much slower if their threads wait for one another."""

_DENSE = DenseAnalysis.name
SOLVER_VARIABLE = "FEMTUNE_SOLVER"
KEPT_ANALYSES: OrderedDict[tuple[str, bool, bytes], tuple[Analysis, int]] = OrderedDict()
_MOST_KEPT = 8
"""Analyses that are kept for further matrices of the same pattern."""
_MOST_ENTRIES = 50_000_000
"""Entries of all patterns whose analyses are kept; beyond, only the last one is, since each has the size of a
matrix."""


def factorise(matrix: sp.csr_array | SymmetricMatrix, solver: str | None = None) -> Factor:
    """Factorise a real or complex symmetric matrix; a pattern that was met before is not analysed again.

    Parameters
    ----------
    solver : a name of `available_solvers`; without one that of the environment variable FEMTUNE_SOLVER, or else the
        fastest at hand for this size

    Raises
    ------
    SingularMatrixError : a pivot is exactly zero
    FemtuneError : ``solver.unavailable``, ``solver.failed``, ``model.memory``
    """
    upper = matrix if isinstance(matrix, SymmetricMatrix) else symmetric(matrix)
    return analyse(upper, solver).factorise(upper)


def analyse(matrix: SymmetricMatrix, solver: str | None = None) -> Analysis:
    """The symbolic factorisation of a pattern, for numbers of the kind (real or complex) that the matrix has.

    Only indices and the type of the numbers are read. `solver` and errors as in `factorise`.
    """
    name = _chosen(matrix, solver)
    if name == _DENSE:
        return DenseAnalysis()
    key = (name, bool(np.iscomplexobj(matrix.data)), _digest(matrix))
    if key not in KEPT_ANALYSES:
        KEPT_ANALYSES[key] = _ANALYSES[name](matrix), len(matrix.indices)
    KEPT_ANALYSES.move_to_end(key)
    analysis = KEPT_ANALYSES[key][0]
    while len(KEPT_ANALYSES) > _MOST_KEPT or (
        len(KEPT_ANALYSES) > 1 and sum(n for _, n in KEPT_ANALYSES.values()) > _MOST_ENTRIES
    ):
        KEPT_ANALYSES.popitem(last=False)
    return analysis


def _digest(matrix: SymmetricMatrix) -> bytes:
    digest = hashlib.blake2b(matrix.indptr.data)
    digest.update(matrix.indices.data)
    return digest.digest()


def solver_asked(solver: str | None = None) -> str | None:
    """The solver that is named, here or in the environment; None if femtune may choose the fastest.

    Raises
    ------
    FemtuneError : ``solver.unavailable``
    """
    asked = solver or os.environ.get(SOLVER_VARIABLE, "").strip()
    return _named(asked) if asked and asked.lower() != "automatic" else None


def _chosen(matrix: SymmetricMatrix, solver: str | None) -> str:
    """The solver that is named, or the fastest one available for this size."""
    name, imaginary = solver_asked(solver), bool(np.iscomplexobj(matrix.data))
    if name is not None:
        # CHOLMOD factorises Hermitian matrices
        return _indefinite() if imaginary and name == "CHOLMOD" else name
    least = PARDISO_FROM_COMPLEX if imaginary else PARDISO_FROM
    if matrix.shape[0] < least:
        return "SuperLU" if imaginary or matrix.shape[0] > DENSE_UP_TO else _DENSE
    return _indefinite() if imaginary else available_solvers()[0]


def _named(asked: str) -> str:
    by_name = {name.lower(): name for name in available_solvers()}
    if asked.lower() in by_name:
        return by_name[asked.lower()]
    known = {name.lower(): name for name in _ANALYSES}
    raise FemtuneError(
        "solver.unavailable/named",
        values={"available": ", ".join(available_solvers())},
        hint=INSTALLATION[known[asked.lower()]] if asked.lower() in known else did_you_mean(asked, known.values()),
        name=asked,
    )


def _indefinite() -> str:
    """The fastest available solver for indefinite or complex matrices."""
    return next(name for name in available_solvers() if name != "CHOLMOD")


def _otherwise(matrix: SymmetricMatrix) -> Analysis:
    return analyse(matrix, _indefinite())


_ANALYSES: dict[str, Callable[[SymmetricMatrix], Analysis]] = {
    "PARDISO": PardisoAnalysis,
    "MUMPS": MumpsAnalysis,
    "CHOLMOD": lambda matrix: CholmodAnalysis(matrix, _otherwise),
    "RSLAB": RslabAnalysis,
    "SuperLU": SuperLuAnalysis,
}
INSTALLATION = {
    "PARDISO": 'pip install "femtune[fast]"',
    "MUMPS": "pip install python-mumps (needs the library, libmumps-seq-dev of Debian, or conda-forge)",
    "CHOLMOD": 'pip install "scikit-sparse<0.5" (needs the library, libsuitesparse-dev of Debian)',
    "RSLAB": 'pip install "femtune[light]"',
    "SuperLU": "comes with SciPy",
}
"""How each solver is installed."""


@lru_cache(maxsize=1)
def available_solvers() -> tuple[str, ...]:
    """Names of the sparse solvers that can be used here, the fastest first."""
    missing = {
        "PARDISO": pardiso.library() is None,
        "MUMPS": isinstance(mumps.library(), str),
        "CHOLMOD": isinstance(cholmod.library(), str),
        "RSLAB": isinstance(rslab.library(), str),
    }
    return tuple(name for name in _ANALYSES if not missing.get(name))
