"""Universal File Format: tests in and out."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.files.uff.measured_functions import FunctionHeader, MeasuredFunction
    from femtune.files.uff.mode_records import ModeRecord
    from femtune.files.uff.read import UffContent, UffFile, read_uff
    from femtune.files.uff.scan import DataSet, scan_uff
    from femtune.files.uff.write import check_modes, write_uff_frfs, write_uff_geometry, write_uff_modes
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "DataSet",
    "FunctionHeader",
    "MeasuredFunction",
    "ModeRecord",
    "UffContent",
    "UffFile",
    "check_modes",
    "read_uff",
    "scan_uff",
    "write_uff_frfs",
    "write_uff_geometry",
    "write_uff_modes",
]
