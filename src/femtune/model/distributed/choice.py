"""Who solves the eigenproblem: femtune itself, or SLEPc over MPI."""

from __future__ import annotations

import os

from femtune.errors import FemtuneError, did_you_mean
from femtune.model.distributed.launch import launcher, ranks, slepc_python

EIGENSOLVER = "FEMTUNE_EIGENSOLVER"
_NAMES = ("own", "slepc")


def check_slepc() -> None:
    """Refuse a chosen eigen-solver that is none, or SLEPc where it cannot be started.

    Raises
    ------
    FemtuneError : ``solver.unavailable``, ``slepc.not-installed``, ``slepc.launcher``
    """
    if slepc_is_chosen():
        slepc_python()
        launcher(ranks())


def slepc_is_chosen() -> bool:
    """True where the environment (or the option --eigensolver) names SLEPc.

    Raises
    ------
    FemtuneError : ``solver.unavailable`` for a name that is none
    """
    name = os.environ.get(EIGENSOLVER, "").strip().lower() or "own"
    if name not in _NAMES:
        raise FemtuneError(
            "solver.unavailable",
            f"there is no eigen-solver '{name}'",
            values={"available": ", ".join(_NAMES)},
            hint=did_you_mean(name, _NAMES),
        )
    return name == "slepc"
