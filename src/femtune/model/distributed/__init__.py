"""The eigenproblem on SLEPc over MPI: processes of another Python, with matrices and results as files."""

from femtune.model.distributed.choice import check_slepc, slepc_is_chosen
from femtune.model.distributed.pairs import SlepcModes, slepc_count, slepc_lowest, slepc_modes, slepc_pairs

__all__ = ["SlepcModes", "check_slepc", "slepc_count", "slepc_is_chosen", "slepc_lowest", "slepc_modes", "slepc_pairs"]
