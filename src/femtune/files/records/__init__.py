"""Time records in: text, UFF, NumPy, MATLAB, HDF5, WAV."""

from femtune.files.records.read import FORMATS, Column, read_record

__all__ = ["FORMATS", "Column", "read_record"]
