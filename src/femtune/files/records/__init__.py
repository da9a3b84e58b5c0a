"""Time records and functions in: text, UFF, NumPy, MATLAB, HDF5, WAV, LVM, TDMS, MDF."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.files.records.frf_file import FunctionColumn, FunctionLayout, read_frfs, read_function_files
    from femtune.files.records.read import ChannelColumn, read_record, read_record_told
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ChannelColumn",
    "FunctionColumn",
    "FunctionLayout",
    "read_frfs",
    "read_function_files",
    "read_record",
    "read_record_told",
]
