"""The eigenproblem on SLEPc over MPI: processes of another Python, with matrices and results as files."""

from femtune.model.distributed.choice import slepc_is_chosen
from femtune.model.distributed.pairs import SlepcModes, slepc_count, slepc_lowest, slepc_modes, slepc_pairs

__all__ = ["SlepcModes", "slepc_count", "slepc_is_chosen", "slepc_lowest", "slepc_modes", "slepc_pairs"]
