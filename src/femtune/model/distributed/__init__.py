"""The eigenproblem on SLEPc over MPI: processes of another Python, with matrices and results as files."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.model.distributed.launch import check_slepc, slepc_is_chosen
    from femtune.model.distributed.pairs import SlepcModes, slepc_count, slepc_lowest, slepc_modes, slepc_pairs
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = ["SlepcModes", "check_slepc", "slepc_count", "slepc_is_chosen", "slepc_lowest", "slepc_modes", "slepc_pairs"]
