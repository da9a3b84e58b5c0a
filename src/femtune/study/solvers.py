"""Which solvers are chosen, looked at before anything is read: nobody waits minutes to hear of a misspelt name."""

from __future__ import annotations

from femtune.errors import ErrorCollector
from femtune.model.distributed import check_slepc
from femtune.model.factorise import solver_asked


def check_solvers() -> None:
    """Refuse solvers that FEMTUNE_SOLVER or FEMTUNE_EIGENSOLVER names and that are not at hand.

    Raises
    ------
    FemtuneError : ``solver.unavailable``, ``slepc.not-installed``, ``slepc.launcher``
    """
    errors = ErrorCollector()
    with errors.catch():
        solver_asked()
    with errors.catch():
        check_slepc()
    errors.raise_if_any()
