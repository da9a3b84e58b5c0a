"""Universal File Format: tests in and out."""

from femtune.files.uff.function_records import FunctionHeader, MeasuredFunction
from femtune.files.uff.mode_records import ModeRecord
from femtune.files.uff.read import UffContent, read_uff
from femtune.files.uff.scan import DataSet, scan_uff
from femtune.files.uff.write import write_uff_modes
from femtune.files.uff.write_frfs import force_unit, write_uff_frfs

__all__ = [
    "DataSet",
    "FunctionHeader",
    "MeasuredFunction",
    "ModeRecord",
    "UffContent",
    "force_unit",
    "read_uff",
    "scan_uff",
    "write_uff_frfs",
    "write_uff_modes",
]
