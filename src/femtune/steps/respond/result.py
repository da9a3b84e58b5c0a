"""The result of `respond`: FRFs, complex modes and static displacements of each configuration, for Python users."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import FrfSet
from femtune.steps.respond.record import ResponseResults
from femtune.study.rows import Rows, rows_of

if TYPE_CHECKING:
    from femtune.steps.respond.record import FrfResults
    from femtune.steps.results import Results
from femtune.steps.result import Arrays, OfConfigurations, ResultWithPage


@dataclass(frozen=True, eq=False, repr=False)
class RespondResult(OfConfigurations[ResponseResults], ResultWithPage):
    """Frequency responses, complex modes and static displacements of each configuration.

    `records` are those of results.json, ``responses``, and `results` holds them in its schema; `arrays` the arrays by
    key, `files` the Universal Files that were written, `report` the page, None without one; `remarks` what a user
    should know.
    """

    page = "responses"
    results: Results = field(kw_only=True)
    arrays: Arrays = field(kw_only=True)
    files: tuple[Path, ...] = field(default=(), kw_only=True)
    report: Path | None = field(default=None, kw_only=True)

    @property
    def frf_sets(self) -> dict[str, FrfSet]:
        """The functions of the model by configuration: values (outputs, inputs, lines), complex."""
        set_of = {r.configuration: r.frfs for r in self.records}
        return {name: frf_set(frfs, self.arrays) for name, frfs in set_of.items() if frfs is not None}

    @property
    def measured_sets(self) -> dict[str, FrfSet]:
        """The test's functions at its own lines, in the kind of the model's; NaN where not measured."""
        sets = {}
        for r in self.records:
            if r.frfs is not None and r.frfs.test_freq_key is not None and r.frfs.test_values_key is not None:
                lines, values = self.arrays[r.frfs.test_freq_key], self.arrays[r.frfs.test_values_key]
                responses, references = DofSet.parse(r.frfs.outputs), DofSet.parse(r.frfs.inputs)
                sets[r.configuration] = FrfSet(lines, values, responses, references, r.frfs.kind, source="test")
        return sets

    @property
    def frfs(self) -> FrfSet:
        """The functions of the only configuration (error ``study.unknown-configuration`` for several)."""
        record = self._only("frf_set")
        if record.frfs is None:
            raise FemtuneError("response.nothing-asked/no-frfs")
        return frf_set(record.frfs, self.arrays)

    @property
    def functions(self) -> Rows:
        """Every function: its largest value and frequency, with those of the test."""
        columns = ("output", "input", "peak_hz", "peak", "test_peak_hz", "test_peak", "frac")
        return Rows.of(
            {"configuration": r.configuration, **row}
            for r in self.records
            if r.frfs is not None
            for row in rows_of(r.frfs.pairs, *columns)
        )

    @property
    def poles(self) -> Rows:
        """Complex modes: frequency in Hz, damping ratio, and the real mode that each resembles."""
        columns = ("kind", "freq_hz", "damping_ratio", "phase_collinearity", "real_mode", "real_freq_hz")
        return Rows.of(
            {"configuration": r.configuration, **row} for r in self.records for row in rows_of(r.poles, *columns)
        )

    @property
    def displacements(self) -> Rows:
        """Static displacements by load and output, in the study's unit of length (rotations in rad)."""
        return Rows.of(
            {"configuration": r.configuration, "load": one.load, "output": d.output, "value": d.value}
            for r in self.records
            for one in r.loads
            for d in one.displacements
        )

    def _sentences(self) -> list[str]:
        sentences = []
        for r in self.records:
            frfs, parts = r.frfs, []
            if frfs is not None:
                lines = self.arrays[frfs.freq_key]
                span = f"{lines[0]:g} to {lines[-1]:g} Hz, {len(lines)} lines"
                parts.append(f"{len(frfs.outputs)} × {len(frfs.inputs)} {frfs.kind}, {span}, {frfs.method}")
            parts += [f"{len(r.poles)} complex modes"] * bool(r.poles) + [f"{len(r.loads)} static loads"] * bool(
                r.loads
            )
            sentences.append(f"{r.configuration}: {'; '.join(parts)}")
        return [*sentences, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.functions or self.displacements


def frf_set(record: FrfResults, arrays: Arrays) -> FrfSet:
    """The functions of a record with their arrays."""
    return FrfSet(
        arrays[record.freq_key], arrays[record.values_key], DofSet.parse(record.outputs), DofSet.parse(record.inputs),
        record.kind, source=f"model, {record.method}",
    )  # fmt: skip
