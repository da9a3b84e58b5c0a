"""Tables of an identification file; docs/identify-file.md explains every key."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PrivateAttr

from femtune.errors import Where
from femtune.files.study_file.kinds import DofLabel, Positive, Text, Units
from femtune.files.study_file.source import Source
from femtune.files.study_file.steps import OutputTable
from femtune.files.study_file.table import Table

KNOWN_INPUT = ("N4SID", "pLSCF")
OUTPUT_ONLY = ("SSI-cov", "SSI-data", "ERA", "FDD", "TFIE")
MethodWord = Literal["N4SID", "pLSCF", "SSI-cov", "SSI-data", "ERA", "FDD", "TFIE"]
Hertz = Annotated[float, Field(ge=0, le=1e12)]


class IdentifyTable(Table):
    """[identify]: what was measured, and how modes are looked for."""

    title: Text | None = None
    record: Text | None = None
    frfs: Text | None = None
    units: Units = "m-kg-s"
    format: Literal["text", "numpy", "matlab", "hdf5", "wav", "uff"] | None = None
    variable: Text | None = None
    sampling_hz: Positive | None = None
    band_hz: tuple[Hertz, Hertz] | None = None
    largest_order: Annotated[int, Field(ge=4, le=200)] | None = None
    methods: Annotated[tuple[MethodWord, ...], Field(min_length=1)] | None = None
    estimator: Literal["H1", "H2", "Hv"] = "H1"
    resolution_hz: Positive | None = None
    period_s: Positive | None = None
    fragments: Annotated[int, Field(ge=1, le=1000)] = 1
    real: bool = True
    take_hz: tuple[Positive, ...] = ()
    drop_hz: tuple[Positive, ...] = ()


class ChannelEntry(Table):
    """[[channel]]: what one column of the record measures."""

    column: Annotated[int, Field(ge=1)] | Text
    dof: DofLabel
    quantity: Literal[
        "displacement", "velocity", "acceleration", "force", "strain", "pressure", "voltage", "unknown"
    ] = "acceleration"
    role: Literal["response", "reference", "input"] = "response"
    unit: str = ""
    factor: float = 1.0


class IdentifyFile(Table):
    """The whole file; names of files are relative to it."""

    identify: IdentifyTable
    channel: tuple[ChannelEntry, ...] = ()
    output: OutputTable = Field(default_factory=lambda: OutputTable(folder="identified"))

    _path: Path = PrivateAttr(default=Path("identify.toml"))
    _source: Source = PrivateAttr(default=Source("identify.toml"))

    @property
    def path(self) -> Path:
        """The file itself."""
        return self._path

    @property
    def measured_path(self) -> Path:
        """The record or the functions."""
        return self._path.parent / (self.identify.record or self.identify.frfs or "")

    @property
    def output_folder(self) -> Path:
        """Where results go."""
        return self._path.parent / self.output.folder

    def where(self, *place: str | int) -> Where:
        """File and line of a key."""
        return self._source.where(place)
