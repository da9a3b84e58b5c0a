"""The command line: one command per step, in the order of use."""

import os

# numpy reads it when it is first imported: its own threads cost small dense matrices ten times the work (updates on
# reduced models, identification), while sparse factorisations and large products have threads of another library
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from femtune.cli.commands import main

__all__ = ["main"]
