"""SLEPc (Krylov-Schur) with MUMPS over MPI on the same matrices, as femtune starts it, with the shift given."""

from __future__ import annotations

from typing import Any

from checks import check_modes, hertz
from stages import Stages
from workspace import Workspace

from cases import MODES
from femtune.model.distributed import slepc_modes


def run(space: Workspace, shift: float | None) -> dict[str, Any]:
    """Files, factorisation and modes in one: SLEPc's processes are others."""
    assert shift is not None
    stages = Stages()
    K, M = space.matrices(0)
    with stages.stage("50 modes"):
        found = slepc_modes(K, M, shift, MODES)
    checked = check_modes((K, M), shift, found.values, found.shapes)
    return {
        "stages": stages.measured,
        "freq_hz": [hertz(found.values).tolist()],
        "checks": {"nominal": vars(checked)},
        "wrong": checked.wrong(),
    }
