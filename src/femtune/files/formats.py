"""Formats of files that femtune reads: matrices, modes of solvers, records of measurements.

A new format is one entry here and the module of its reader. The words of the study file and of the identification file,
their schemas, the messages and the tables of the documentation are made from these lists. Readers are imported when a
file is read: a study file is checked without numpy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

if TYPE_CHECKING:
    from femtune.files.matrices.read_matrix import ReadMatrix
    from femtune.files.modes.solved import SolvedModes
    from femtune.files.records.arrays import NamedArrays
    from femtune.files.records.clocks import ClockGroup
    from femtune.files.records.table import RecordTable


@dataclass(frozen=True, kw_only=True)
class FileFormat:
    """One format.

    Parameters
    ----------
    key : its name in a study
    suffixes : extensions of its files in small letters, ``.op4``; () if any
    written_by : programs and their commands, for the documentation
    content : what is read, for the documentation
    reader : module below `femtune.files` and function
    extra : what must be installed with femtune to read it
    """

    key: str
    suffixes: tuple[str, ...] = ()
    written_by: str
    content: str
    reader: str
    extra: str | None = None

    @property
    def reader_function(self) -> Callable[..., Any]:
        """The function that `reader` names."""
        module, _, function = self.reader.rpartition(".")
        return getattr(import_module(f"femtune.files.{module}"), function)


FormatT = TypeVar("FormatT", bound=FileFormat)


class Formats(Generic[FormatT]):
    """The formats of one kind of file, in the order in which messages list them."""

    def __init__(self, *formats: FormatT) -> None:
        self._by_key = {one.key: one for one in formats}
        self._by_suffix = {suffix: one for one in formats for suffix in one.suffixes}
        assert len(self._by_key) == len(formats)
        assert len(self._by_suffix) == sum(len(one.suffixes) for one in formats)

    def __iter__(self) -> Iterator[FormatT]:
        return iter(self._by_key.values())

    def __getitem__(self, key: str) -> FormatT:
        return self._by_key[key]

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of all formats."""
        return tuple(self._by_key)

    @property
    def suffixes(self) -> tuple[str, ...]:
        """Extensions that tell a format."""
        return tuple(self._by_suffix)

    def of_suffix(self, path: Path) -> FormatT | None:
        """The format that the extension of a file tells."""
        return self._by_suffix.get(path.suffix.lower())


# ----------------------------------------------------------------------------------------------------
# Matrices of other solvers.


@dataclass(frozen=True, kw_only=True)
class MatrixFormat(FileFormat):
    """A format of matrices; `content` says where the DOFs of the rows come from.

    Parameters
    ----------
    signature : first bytes that tell the format whatever the extension, in any case of letters; b"" without one
    """

    signature: bytes = b""

    def read(self, path: Path, name: str | None) -> ReadMatrix:
        """The matrix called `name`; the first one without a name."""
        matrix: ReadMatrix = self.reader_function(path, name)
        return matrix


_DOFS_BY_TABLE = "`dofs`, or all DOFs of `grid` in ascending order"

MATRIX_FORMATS = Formats(
    MatrixFormat(
        key="op4",
        suffixes=(".op4",),
        written_by="Nastran: OUTPUT4, binary of either byte order, or text; dense, sparse, big matrix",
        content=_DOFS_BY_TABLE,
        reader="matrices.op4.read_op4",
    ),
    MatrixFormat(
        key="op2",
        suffixes=(".op2",),
        written_by="Nastran; small matrices only, because the library stores their zeros",
        content=_DOFS_BY_TABLE,
        reader="matrices.op2.read_op2",
        extra="op2",
    ),
    MatrixFormat(
        key="dmig",
        suffixes=(".pch", ".bdf", ".dat", ".nas", ".dmig"),
        written_by="Nastran: DMIG cards of PUNCH and EXTSEOUT",
        content="the cards",
        reader="matrices.dmig.read_dmig",
    ),
    MatrixFormat(
        key="abaqus",
        suffixes=(".mtx",),
        written_by=r"Abaqus: \*MATRIX OUTPUT, FORMAT=MATRIX INPUT or COORDINATE",
        content="the file; `dofs` for COORDINATE",
        reader="matrices.abaqus.read_abaqus",
    ),
    MatrixFormat(
        key="calculix",
        suffixes=(".sti", ".mas"),
        written_by=r"CalculiX: \*FREQUENCY, SOLVER=MATRIXSTORAGE",
        content="the `.dof` file in the same folder",
        reader="matrices.calculix.read_calculix",
    ),
    MatrixFormat(
        key="matrix-market",
        suffixes=(".mm",),
        signature=b"%%matrixmarket",
        written_by="SciPy and many others: Matrix Market, with any extension",
        content="`dofs`",
        reader="matrices.matrix_market.read_matrix_market",
    ),
    MatrixFormat(
        key="ansys",
        suffixes=(".full",),
        written_by="Ansys",
        content="the file, with its constrained DOFs",
        reader="matrices.ansys.read_ansys",
        extra="ansys",
    ),
)

# ----------------------------------------------------------------------------------------------------
# Modes that solvers compute. A study names the format: several solvers share an extension.


@dataclass(frozen=True, kw_only=True)
class ModesFormat(FileFormat):
    """A format of modes.

    Parameters
    ----------
    error_texts : what the solver prints if a run has failed, whatever exit code it ends with
    """

    error_texts: tuple[str, ...] = ()

    def read(self, path: Path) -> SolvedModes:
        """The modes of a file."""
        modes: SolvedModes = self.reader_function(path)
        return modes


_NASTRAN_ERRORS = ("FATAL MESSAGE", "*ERROR")

MODES_FORMATS = Formats(
    ModesFormat(
        key="abaqus-dat",
        written_by="Abaqus: `.dat`",
        content=r"frequencies of the last `*FREQUENCY` step, with the five digits of the listing",
        reader="modes.abaqus.read_abaqus_dat",
        error_texts=("***ERROR",),
    ),
    ModesFormat(
        key="ansys-rst",
        written_by="Ansys: `.rst`",
        content="frequencies and shapes of a modal analysis",
        reader="modes.ansys_rst.read_rst",
        extra="ansys",
        error_texts=("*** ERROR ***",),
    ),
    ModesFormat(
        key="calculix-dat",
        written_by="CalculiX: `.dat`",
        content="frequencies",
        reader="modes.calculix.read_dat",
        error_texts=("*ERROR",),
    ),
    ModesFormat(
        key="calculix-frd",
        written_by="CalculiX: `.frd`",
        content="frequencies and shapes: `*NODE FILE` with `U`, for beams and shells with `OUTPUT=2D`; participation "
        "factors: `RF`",
        reader="modes.calculix.read_frd",
        error_texts=("*ERROR",),
    ),
    ModesFormat(
        key="nastran-f06",
        written_by="Nastran: `.f06`",
        content="frequencies, shapes of `DISPLACEMENT(PRINT) = ALL`, mass of `PARAM,GRDPNT`",
        reader="modes.nastran_text.read_f06",
        error_texts=_NASTRAN_ERRORS,
    ),
    ModesFormat(
        key="nastran-op2",
        written_by="Nastran: `.op2`",
        content="frequencies and shapes of `PARAM,POST,-1`",
        reader="modes.nastran_op2.read_op2_modes",
        extra="op2",
        error_texts=_NASTRAN_ERRORS,
    ),
    ModesFormat(
        key="nastran-punch",
        written_by="Nastran: `.pch`",
        content="frequencies and shapes of `DISPLACEMENT(PUNCH) = ALL`",
        reader="modes.nastran_text.read_punch",
        error_texts=_NASTRAN_ERRORS,
    ),
    ModesFormat(
        key="table",
        written_by="a script, for any other solver",
        content="a line of frequencies in Hz; a line for each node and direction (`12Z+ 0.5 0.1`); `mass 12.5`; "
        "participation factors (`participation X 1.2 0.3`, directions `X` to `RZ`); last line `end`",
        reader="modes.plain_table.read_plain_table",
    ),
)

# ----------------------------------------------------------------------------------------------------
# Records of measurements: time records, and frequency response functions as arrays or columns.


@dataclass(frozen=True, kw_only=True)
class RecordFormat(FileFormat):
    """A format of records; its reader returns a table of columns, groups of channels, or opens the arrays of the file.

    Parameters
    ----------
    has : "columns" of a text, "arrays" with names, "channels": time records that say what they are, or "groups" of
        these with a clock of their own
    signatures : first bytes that tell the format whatever the extension
    """

    has: Literal["columns", "arrays", "channels", "groups"]
    signatures: tuple[bytes, ...] = ()

    def read_table(self, path: Path) -> RecordTable:
        """The columns or channels of a file."""
        table: RecordTable = self.reader_function(path)
        return table

    def read_groups(self, path: Path) -> list[ClockGroup]:
        """The groups of channels of a file."""
        groups: list[ClockGroup] = self.reader_function(path)
        return groups

    def open_arrays(self, path: Path) -> AbstractContextManager[NamedArrays]:
        """All arrays of a file by name, fields of structures with dots; those of HDF5 are read when they are used."""
        opened: AbstractContextManager[NamedArrays] = self.reader_function(path)
        return opened


RECORD_FORMATS = Formats(
    RecordFormat(
        key="text",
        suffixes=(".csv", ".txt", ".dat", ".asc", ".tsv"),
        written_by="data acquisition systems, spreadsheets",
        content="columns separated by commas, semicolons, tabs or blanks",
        reader="records.text.read_text",
        has="columns",
    ),
    RecordFormat(
        key="numpy",
        suffixes=(".npy", ".npz"),
        written_by="NumPy",
        content="an array, or the one that `variable` names",
        reader="records.arrays.open_npy",
        has="arrays",
    ),
    RecordFormat(
        key="matlab",
        suffixes=(".mat",),
        written_by="MATLAB; version 7.3 needs the extra `hdf5`",
        content="the array that `variable` names",
        reader="records.arrays.open_mat",
        has="arrays",
    ),
    RecordFormat(
        key="hdf5",
        suffixes=(".h5", ".hdf5"),
        written_by="many programs",
        content="the dataset that `variable` names; groups with slashes or dots",
        reader="records.arrays.open_hdf5",
        extra="hdf5",
        has="arrays",
    ),
    RecordFormat(
        key="wav",
        suffixes=(".wav",),
        written_by="sound recorders",
        content="channels as fractions of full scale, and the sampling rate",
        reader="records.waves.read_wav",
        has="channels",
        signatures=(b"RIFF", b"RIFX", b"RF64"),
    ),
    RecordFormat(
        key="lvm",
        suffixes=(".lvm",),
        written_by="LabVIEW: measurement files as text",
        content="channels with their names, units and times, in one or several segments",
        reader="records.lvm.read_lvm",
        has="groups",
        signatures=(b"LabVIEW Measurement",),
    ),
    RecordFormat(
        key="tdms",
        suffixes=(".tdms",),
        written_by="LabVIEW, FlexLogger",
        content="channels with their names, units and time step; `variable` names one of several groups",
        reader="records.tdms.read_tdms",
        extra="tdms",
        has="groups",
        signatures=(b"TDSm",),
    ),
    RecordFormat(
        key="mdf",
        suffixes=(".mf4", ".mdf"),
        written_by="data loggers and test systems: ASAM MDF of version 4",
        content="channels with their names, units and times; `variable` names one of several groups",
        reader="records.mdf.read_mdf",
        has="groups",
        signatures=(b"MDF     ", b"UnFinMF "),
    ),
    RecordFormat(
        key="uff",
        suffixes=(".uff", ".unv", ".ufb", ".bunv"),
        written_by="programs for modal tests: Universal Files, data set 58",
        content="time records with their DOFs, quantities and units",
        reader="records.waves.read_uff_time",
        has="channels",
    ),
)

if TYPE_CHECKING:
    MatrixFormatKey = str
    ModesFormatKey = str
    RecordFormatKey = str
else:
    # pydantic validates a study against these words, and the schemas list them
    MatrixFormatKey = Literal[MATRIX_FORMATS.keys]
    ModesFormatKey = Literal[MODES_FORMATS.keys]
    RecordFormatKey = Literal[RECORD_FORMATS.keys]
