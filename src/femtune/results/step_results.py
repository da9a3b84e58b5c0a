"""Results of the steps: records, arrays and remarks as one object.

A step that looks at each configuration returns a sequence with one record a configuration; a step on the whole study
returns one record. Tables are `Rows`, which ``pandas.DataFrame`` takes as they are.
"""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError, did_you_mean
from femtune.modal import FrfSet
from femtune.results.tables import Rows, rows_of, text_of

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.modal import ModeSet
    from femtune.results.base import Alert, ModelVersion
    from femtune.results.candidates import CandidatesResults
    from femtune.results.correlation import CorrelationResults
    from femtune.results.global_search import GlobalSearchResults
    from femtune.results.model import ModelFacts, ModelModes
    from femtune.results.plan import PlanResults
    from femtune.results.quantify import QuantifyResults
    from femtune.results.response import FrfResults, ResponseResults
    from femtune.results.results import Results
    from femtune.results.screen import ScreenResults
    from femtune.results.update import SelectionResults

Arrays = Mapping[str, NDArray[Any]]
R = TypeVar("R", "ModelModes", "ResponseResults", "CorrelationResults")

_MOST_LINES, _LONGEST_LINE = 7, 160


class StepResult(ABC):
    """Base of the results of steps: a short `repr`, and a table in a notebook."""

    @abstractmethod
    def _sentences(self) -> list[str]:
        """Its sentences, the most important first."""

    @abstractmethod
    def _table(self) -> Rows:
        """The table that a notebook shows."""

    def __repr__(self) -> str:
        lines = [
            f"{type(self).__name__}: {text}" if i == 0 else f"  {text}" for i, text in enumerate(self._sentences())
        ]
        more = len(lines) - _MOST_LINES
        return "\n".join([*lines[:_MOST_LINES], *([f"  … and {more} more"] if more > 0 else [])])

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>{self._table()._repr_html_()}"


def _one_line(text: str) -> str:
    return text if len(text) <= _LONGEST_LINE else text[: _LONGEST_LINE - 1] + "…"


@dataclass(frozen=True, eq=False, repr=False)
class OfConfigurations(StepResult, Sequence[R], Generic[R]):
    """One record a configuration: by position, or by the name of the configuration.

    `records` are those of results.json, `remarks` are notices beside the result: what the reader of the deck warns of,
    and how many solutions came from the journal of an earlier run. Each has `code`, `level` and `what`; `str` gives its
    text.
    """

    records: tuple[R, ...]
    remarks: tuple[Notice, ...] = field(default=(), kw_only=True)

    @overload
    def __getitem__(self, which: int | str) -> R: ...
    @overload
    def __getitem__(self, which: slice) -> tuple[R, ...]: ...
    def __getitem__(self, which: int | str | slice) -> R | tuple[R, ...]:
        return self.records[which if isinstance(which, int | slice) else self._position(which)]

    def __len__(self) -> int:
        return len(self.records)

    @property
    def configurations(self) -> tuple[str, ...]:
        """Names of the configurations, in the order of the study."""
        return tuple(record.configuration for record in self.records)

    def _position(self, name: str) -> int:
        if name not in self.configurations:
            raise FemtuneError(
                "study.unknown-configuration/no-result", hint=did_you_mean(name, self.configurations), name=name
            )
        return self.configurations.index(name)

    def _only(self, word: str) -> R:
        """The record where there is a single configuration."""
        if len(self.records) == 1:
            return self.records[0]
        code = "study.unknown-configuration/several" if self.records else "study.unknown-configuration/no-results"
        values = {"configurations": ", ".join(self.configurations)}
        raise FemtuneError(code, values=values, count=len(self.records), property=word)


@dataclass(frozen=True, eq=False, repr=False)
class InfoResult(StepResult):
    """Summary of a deck: cards, mass, supports, rigid-body check, elements out of shape, errors due to the mesh.

    `record` is that of results.json, ``model``.
    """

    record: ModelFacts

    @property
    def cards(self) -> Rows:
        """Kinds of cards: `name`, `count`, `used`, and the `reason` why a kind is not used."""
        read = [{"name": c.name, "count": c.count, "used": True, "reason": ""} for c in self.record.cards_read]
        left = (
            {"name": c.name, "count": c.count, "used": False, "reason": c.reason} for c in self.record.cards_ignored
        )
        return Rows.of([*read, *left])

    @property
    def configurations(self) -> Rows:
        """Grid points, DOFs, mass (units of the study) and outcome of the rigid-body check, by configuration."""
        return Rows.of(
            {
                "configuration": c.configuration,
                "grids": c.grids,
                "free_dofs": c.free_dofs,
                "mass": c.mass,
                "weighed_mass": c.weighed_mass,
                "mass_difference_percent": c.mass_difference_percent,
                "rigid_body_check": c.rigid_body_check.verdict,
            }
            for c in self.record.configurations
        )

    @property
    def notices(self) -> tuple[Alert, ...]:
        """Notices of the study (units, tests, sensors) and of the deck reader."""
        return self.record.notices

    def _sentences(self) -> list[str]:
        used = sum(c.count for c in self.record.cards_read)
        ignored = sum(c.count for c in self.record.cards_ignored)
        each = [
            f"{c.configuration}: {c.grids} points, {c.free_dofs} free DOFs, "
            f"mass {'not known' if c.mass is None else f'{c.mass:.6g}'}, "
            f"rigid-body check: {c.rigid_body_check.verdict}"
            for c in self.record.configurations
        ]
        return [f"{used} cards used, {ignored} not used", *each, *(f"{a.level}: {a.sentence}" for a in self.notices)]

    def _table(self) -> Rows:
        return self.configurations


@dataclass(frozen=True, eq=False, repr=False)
class ModesResult(OfConfigurations["ModelModes"]):
    """Natural modes of each configuration, at the initial values of the parameters.

    `records` are those of results.json, ``modes``; `remarks` what a user should know; `shapes` gives the shapes by
    configuration, `whole` the results and their arrays; `report` is the page that was written, None without one.
    """

    shapes: Callable[[], Mapping[str, ModeSet]] = field(kw_only=True)
    whole: Callable[[], tuple[Results, Arrays]] = field(kw_only=True)
    report: Path | None = field(default=None, kw_only=True)

    @property
    def frequencies(self) -> Rows:
        """`configuration`, number of the `mode` from 1, `freq_hz`, and whether it is a `rigid_body` motion."""
        return Rows.of(
            {"configuration": m.configuration, "mode": i + 1, "freq_hz": f, "rigid_body": i < m.rigid_body_modes}
            for m in self.records
            for i, f in enumerate(m.freq_hz)
        )

    @property
    def mesh_errors(self) -> Rows:
        """`configuration`, `mode`, `freq_hz`, `refined_hz` of a mesh of half the element size, estimated
        `error_percent` due to the mesh, and `converged_hz`; none where the mesh was not checked."""
        return Rows.of(
            {"configuration": r.configuration, **m.model_dump()}
            for r in self.records
            for m in (r.mesh.modes if r.mesh is not None else ())
        )

    @property
    def freq_hz(self) -> NDArray[np.float64]:
        """(modes,) frequencies in Hz of the only configuration (error ``study.unknown-configuration`` for several)."""
        return np.array(self._only("record").freq_hz)

    @cached_property
    def mode_sets(self) -> Mapping[str, ModeSet]:
        """By configuration: modes with mass-normalised shapes at all DOFs of the model, in its displacement frames."""
        return self.shapes()

    @property
    def results(self) -> Results:
        """The results in the schema of results.json: provenance, facts of the model, modes, shapes for drawing."""
        return self._whole[0]

    @property
    def arrays(self) -> Arrays:
        """Arrays that `results` refers to by key."""
        return self._whole[1]

    @cached_property
    def _whole(self) -> tuple[Results, Arrays]:
        return self.whole()

    def _sentences(self) -> list[str]:
        found = []
        for m in self.records:
            shown = ", ".join(f"{f:.5g}" for f in m.freq_hz[:6]) + (" …" if len(m.freq_hz) > 6 else "")
            rigid = f", {m.rigid_body_modes} of them rigid-body modes" if m.rigid_body_modes else ""
            found.append(f"{m.configuration}: {len(m.freq_hz)} modes{rigid}: {shown} Hz")
        return [*found, *(a.sentence for m in self.records for a in m.alerts), *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.frequencies


@dataclass(frozen=True, eq=False, repr=False)
class PlanResult(StepResult):
    """A planned test: sensors, and what they are worth for the target modes.

    `record` is that of results.json, ``plan``; `results` has it with the facts of the model, `arrays` the arrays by
    key, `files` the files that were written, `report` the page, None without one; `remarks` what a user should know.
    """

    record: PlanResults
    results: Results
    arrays: Arrays
    remarks: tuple[Notice, ...] = ()
    files: tuple[Path, ...] = ()
    report: Path | None = None

    @property
    def sensors(self) -> Rows:
        """Sensors: `name`, `kind`, `node`, `dofs` of the test, coordinates, and effective `independence`."""
        return Rows.of(
            {
                "name": s.name,
                "kind": s.kind,
                "node": s.node,
                "dofs": " ".join(s.dofs),
                "x": s.position[0],
                "y": s.position[1],
                "z": s.position[2],
                "independence": s.independence,
            }
            for s in self.record.sensors
        )

    @property
    def modes(self) -> Rows:
        """Target modes: `number`, `freq_hz`, largest AutoMAC at the sensors and at all candidates."""
        columns = ("number", "freq_hz", "rigid_body", "auto_mac", "alike_number", "auto_mac_candidates")
        return rows_of(self.record.modes, *columns)

    @property
    def exciters(self) -> Rows:
        """Exciters: `name`, `node`, `dof` of the test, and the `sensor` at the driving point."""
        return rows_of(self.record.exciters, "name", "node", "dof", "sensor")

    @property
    def excitation(self) -> Rows:
        """Target modes: the `exciter` that excites each most, its `level`, and the mode `indicator` of all."""
        return rows_of(self.record.excitation, "number", "exciter", "level", "indicator")

    @property
    def parameters(self) -> Rows:
        """Free parameters: standard deviation of the prior, and those that an update with this test would have."""
        columns = ("name", "unit", "nominal", "prior_sd", "expected_sd", "worst_sd", "data_sd", "frequencies_sd")
        return rows_of(self.record.parameters, *columns)

    @property
    def calibration_lines(self) -> NDArray[np.float64] | None:
        """(lines,) frequency lines for a calibration in Hz; None if there are none."""
        lines = self.record.frequency_lines
        return None if lines is None else self.arrays[lines.calibration_key]

    @property
    def chosen_lines(self) -> NDArray[np.float64] | None:
        """(lines,) those of them, in Hz, that determine the parameters best; None where all are compared."""
        functions = self.record.functions
        return None if functions is None or functions.lines_key is None else self.arrays[functions.lines_key]

    @property
    def auto_mac(self) -> NDArray[np.float64]:
        """(m, m) AutoMAC of the target modes at the sensors."""
        return self.arrays[self.record.auto_mac_key]

    def _sentences(self) -> list[str]:
        chosen, kinds = self.record.chosen, [s.kind for s in self.record.sensors]
        counts = [f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds)]
        condition = "infinite" if chosen.condition is None else f"{chosen.condition:.3g}"
        return [
            f"{self.record.configuration}: {', '.join(counts)} sensors for {len(self.record.modes)} target modes",
            f"largest AutoMAC {chosen.auto_mac:.3f}, condition number {condition}",
            *(f"{a.level}: {a.sentence}" for a in self.record.alerts),
            *map(str, self.remarks),
        ]

    def _table(self) -> Rows:
        return self.sensors


@dataclass(frozen=True, eq=False, repr=False)
class ScreenResult(StepResult):
    """Effects of the parameters on the natural frequencies, by designed runs.

    `record` is that of results.json, ``screen``; `results` has it with the facts of the study, `arrays` the arrays by
    key, `files` the files that were written, `report` the page, None without one; `remarks` what a user should know.
    """

    record: ScreenResults
    results: Results
    arrays: Arrays
    remarks: tuple[Notice, ...] = ()
    files: tuple[Path, ...] = ()
    report: Path | None = None

    @property
    def effects(self) -> Rows:
        """Effect of each parameter on each mode.

        Of a design by levels `contribution`, `f_value`, `p_value`, `range_hz`; of Morris `mean_hz`, `absolute_hz`,
        `absolute_margin_hz`, `spread_hz`; of Sobol `first`, `total`.
        """
        place, record = ("parameter", "configuration", "mode"), self.record
        if record.elementary:
            return rows_of(record.elementary, *place, "mean_hz", "absolute_hz", "absolute_margin_hz", "spread_hz")
        if record.indices:
            return rows_of(record.indices, *place, "first", "total")
        return rows_of(record.effects, *place, "contribution", "f_value", "p_value", "range_hz")

    @property
    def modes(self) -> Rows:
        """The modes: initial and mean frequency, what is not explained, smallest MAC of the followed shape."""
        columns = ("configuration", "mode", "freq_hz", "mean_hz", "error_contribution", "least_mac")
        return rows_of(self.record.modes, *columns)

    @property
    def runs(self) -> NDArray[np.float64]:
        """(runs, parameters + modes) values of the free parameters, and frequencies in Hz; NaN where a run failed."""
        return self.arrays[self.record.table_key]

    def _sentences(self) -> list[str]:
        alerts = [f"{a.level}: {a.sentence}" for a in self.record.alerts]
        return [
            f"{self.record.design}, {self.record.runs} runs",
            *self.record.sentences,
            *alerts,
            *map(str, self.remarks),
        ]

    def _table(self) -> Rows:
        return self.effects


@dataclass(frozen=True, eq=False, repr=False)
class SearchResult(StepResult):
    """The minimum of the squared residuals within the bounds, by a search of the whole box.

    `record` is that of results.json, ``search``; `results` has it with the facts of the study, `arrays` the arrays by
    key, `report` the page, None without one; `remarks` what a user should know.
    """

    record: GlobalSearchResults
    results: Results
    arrays: Arrays
    remarks: tuple[Notice, ...] = ()
    report: Path | None = None

    @property
    def parameters(self) -> Rows:
        """The free parameters: `initial`, `found` by the search, and `value` after least squares on the model."""
        return rows_of(
            self.record.parameters, "name", "unit", "lower", "upper", "initial", "found", "value", "at_bound"
        )

    @property
    def values(self) -> dict[str, float]:
        """Values after least squares on the model, by name."""
        return {p.name: p.value for p in self.record.parameters}

    @property
    def seeds(self) -> Rows:
        """The searches: `evaluations`, `chi2` at the end, whether it is the `same` minimum."""
        return rows_of(self.record.seeds, "seed", "evaluations", "chi2", "same", "converged")

    @property
    def history(self) -> NDArray[np.float64]:
        """(points, 3) convergence of the searches: seed, evaluations, smallest χ² so far."""
        return self.arrays[self.record.history_key]

    @property
    def front(self) -> NDArray[np.float64]:
        """(points, parameters + 2) front: values of the free parameters, frequency errors, other errors; (0, …) without
        one."""
        if self.record.front is None:
            return np.zeros((0, len(self.record.parameters) + 2))
        return self.arrays[self.record.front.front_key]

    def _sentences(self) -> list[str]:
        alerts = [f"{a.level}: {a.sentence}" for a in self.record.alerts]
        return [
            f"{self.record.method} on the {self.record.on}",
            *self.record.sentences,
            *alerts,
            *map(str, self.remarks),
        ]

    def _table(self) -> Rows:
        return self.parameters


@dataclass(frozen=True, eq=False, repr=False)
class CandidatesResult(StepResult):
    """Candidate models, each updated from the same test, and their comparison.

    `record` is that of results.json, ``candidates``; `results` has it with the facts of the study, `arrays` the arrays
    by key, `report` the page, None without one; `remarks` what a user should know.
    """

    record: CandidatesResults
    results: Results
    arrays: Arrays
    remarks: tuple[Notice, ...] = ()
    report: Path | None = None

    @property
    def candidates(self) -> Rows:
        """Models with their criteria; see `CandidateResults` in the schema of the results."""
        columns = (
            "name", "status", "rank", "error_percent", "prediction_percent", "bic", "bic_weight", "log_evidence",
            "probability", "worst_residual", "worst_label", "admissible", "cluster", "starts_at_best",
        )  # fmt: skip
        return rows_of(self.record.candidates, *columns)

    @property
    def values(self) -> dict[str, dict[str, float]]:
        """By candidate that was solved, the values of all parameters at its optimum."""
        return {c.name: {v.parameter: v.value for v in c.values} for c in self.record.solved}

    @property
    def distances(self) -> NDArray[np.float64]:
        """(m, m) root mean square difference of the parameters of the solved candidates, relative to initial values."""
        return self.arrays[self.record.distances_key]

    def _sentences(self) -> list[str]:
        alerts = [f"{a.level}: {a.sentence}" for a in self.record.alerts]
        return [f"{len(self.record.candidates)} models", *self.record.sentences, *alerts, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.candidates


@dataclass(frozen=True, eq=False, repr=False)
class RespondResult(OfConfigurations["ResponseResults"]):
    """Frequency responses, complex modes and static displacements of each configuration.

    `records` are those of results.json, ``responses``, and `results` holds them in its schema; `arrays` the arrays by
    key, `files` the Universal Files that were written, `report` the page, None without one; `remarks` what a user
    should know.
    """

    results: Results = field(kw_only=True)
    arrays: Arrays = field(kw_only=True)
    files: tuple[Path, ...] = field(default=(), kw_only=True)
    report: Path | None = field(default=None, kw_only=True)

    @property
    def frf_sets(self) -> dict[str, FrfSet]:
        """The functions of the model by configuration: values (outputs, inputs, lines), complex."""
        found = {r.configuration: r.frfs for r in self.records}
        return {name: frf_set(frfs, self.arrays) for name, frfs in found.items() if frfs is not None}

    @property
    def measured_sets(self) -> dict[str, FrfSet]:
        """The test's functions at its own lines, in the kind of the model's; NaN where not measured."""
        found = {}
        for r in self.records:
            if r.frfs is not None and r.frfs.test_freq_key is not None and r.frfs.test_values_key is not None:
                lines, values = self.arrays[r.frfs.test_freq_key], self.arrays[r.frfs.test_values_key]
                responses, references = DofSet.parse(r.frfs.outputs), DofSet.parse(r.frfs.inputs)
                found[r.configuration] = FrfSet(lines, values, responses, references, r.frfs.kind, source="test")
        return found

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
        found = []
        for r in self.records:
            frfs, parts = r.frfs, []
            if frfs is not None:
                lines = self.arrays[frfs.freq_key]
                span = f"{lines[0]:g} to {lines[-1]:g} Hz, {len(lines)} lines"
                parts.append(f"{len(frfs.outputs)} × {len(frfs.inputs)} {frfs.kind}, {span}, {frfs.method}")
            parts += [f"{len(r.poles)} complex modes"] * bool(r.poles) + [f"{len(r.loads)} static loads"] * bool(
                r.loads
            )
            found.append(f"{r.configuration}: {'; '.join(parts)}")
        return [*found, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.functions or self.displacements


def frf_set(record: FrfResults, arrays: Arrays) -> FrfSet:
    """The functions of a record with their arrays."""
    return FrfSet(
        arrays[record.freq_key], arrays[record.values_key], DofSet.parse(record.outputs), DofSet.parse(record.inputs),
        record.kind, source=f"model, {record.method}",
    )  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class CorrelateResult(OfConfigurations["CorrelationResults"]):
    """Test against model in each configuration with a test.

    `records` are those of results.json, ``correlations``, `arrays` by their keys; `files` were written; `remarks` what
    a user should know.
    """

    arrays: Arrays = field(kw_only=True)
    files: tuple[Path, ...] = field(default=(), kw_only=True)

    @property
    def pairs(self) -> Rows:
        """Paired modes: frequencies in Hz, error in %, MAC."""
        columns = ("test_label", "test_freq_hz", "model_number", "model_freq_hz", "freq_error_percent", "mac")
        return Rows.of(
            {"configuration": c.configuration, **row} for c in self.records for row in rows_of(c.pairs, *columns)
        )

    @property
    def unpaired(self) -> Rows:
        """Modes of the test without a partner, and those that the study leaves out, with the reason."""
        return Rows.of(
            {"configuration": c.configuration, **row}
            for c in self.records
            for row in rows_of((*c.unpaired_test, *c.left_out), "test_label", "test_freq_hz", "reason")
        )

    @property
    def criteria(self) -> Rows:
        """Acceptance criteria with measured value, limit and verdict."""
        columns = ("name", "sense", "limit", "measured", "unit", "verdict", "remark")
        return Rows.of(
            {"configuration": c.configuration, **row} for c in self.records for row in rows_of(c.criteria, *columns)
        )

    @property
    def comac(self) -> Rows:
        """COMAC of each measured DOF over the paired modes."""
        return Rows.of(
            {"configuration": c.configuration, **row} for c in self.records for row in rows_of(c.comac, "dof", "comac")
        )

    @property
    def contributions(self) -> Rows:
        """eCOMAC of each measured DOF, and the change of the MAC when it is left out."""
        columns = ("dof", "ecomac", "mac_change", "largest_change", "largest_change_label")
        return Rows.of(
            {"configuration": c.configuration, **row}
            for c in self.records
            for row in rows_of(c.contributions, *columns)
        )

    @property
    def expanded(self) -> dict[str, ModeSet]:
        """Test shapes expanded to the DOFs of the model's grid points, in basic axes, by configuration."""
        from femtune.results.expansion import expanded_modes  # noqa: PLC0415

        return {
            c.configuration: expanded_modes(c.expansion, self.arrays) for c in self.records if c.expansion is not None
        }

    @property
    def expansion(self) -> Rows:
        """Error of each expansion method at sensors that were left out, in %, one line a test mode; `misfit_percent` is
        that of the method in use at all sensors."""
        return Rows.of(
            {
                "configuration": c.configuration,
                "test_label": m.test_label,
                "test_freq_hz": m.test_freq_hz,
                "method": c.expansion.method,
                "misfit_percent": m.misfit_percent,
                **{e.method: e.error_percent for e in m.errors},
            }
            for c in self.records
            if c.expansion is not None
            for m in c.expansion.modes
        )

    @property
    def macs(self) -> dict[str, NDArray[np.float64]]:
        """MAC (test modes, model modes) by configuration."""
        return {c.configuration: self.arrays[c.mac_key] for c in self.records if c.mac_key is not None}

    @property
    def mac(self) -> NDArray[np.float64]:
        """(test modes, model modes) MAC of the only configuration (error ``study.unknown-configuration`` for several).

        Raises
        ------
        FemtuneError : ``correlate.no-shapes`` where the test has no shapes
        """
        key = self._only("mac").mac_key
        if key is None:
            raise FemtuneError("correlate.no-shapes")
        return np.asarray(self.arrays[key])

    def _sentences(self) -> list[str]:
        found = []
        for c in self.records:
            tests = len(c.pairs) + len(c.unpaired_test)
            worst = max(c.pairs, key=lambda p: abs(p.freq_error_percent), default=None)
            macs = [p.mac for p in c.pairs if p.mac is not None]
            text = f"{c.configuration}: {len(c.pairs)} of {tests} test modes paired"
            if worst is not None:
                text += f"; largest frequency error {worst.freq_error_percent:+.3g} % (mode {worst.test_label})"
            found.append(text + (f"; lowest MAC {min(macs):.3f}" if macs else ""))
        return [*found, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.pairs


@dataclass(frozen=True, eq=False, repr=False)
class SelectResult(StepResult):
    """Which parameters and combinations of parameters the data determine.

    `record` is that of results.json, ``selection``; `arrays` by its keys; `remarks` as those of the other steps.
    """

    record: SelectionResults
    arrays: Arrays = field(repr=False)
    remarks: tuple[Notice, ...] = ()

    @property
    def parameters(self) -> Rows:
        """One line a free parameter: posterior over prior standard deviation, and the verdict."""
        return rows_of(self.record.parameters, "parameter", "sd_ratio", "verdict", "sentence")

    @property
    def sensitivities(self) -> Rows:
        """Change of each frequency in % for 1 % of each parameter's initial value; one column per parameter."""
        names = self.record.column_labels
        return Rows.of(
            {"configuration": s.configuration, "test_label": s.test_label, **dict(zip(names, s.percent_per_percent))}
            for s in self.record.sensitivities
        )

    @property
    def jacobian(self) -> NDArray[np.float64]:
        """(residuals, parameters) scaled Jacobian; rows are ``record.row_labels``, columns ``record.column_labels``."""
        return np.asarray(self.arrays[str(self.record.jacobian_key)])

    @property
    def correlation(self) -> NDArray[np.float64] | None:
        """(parameters, parameters) posterior correlation of the parameters; None where it is not known."""
        key = self.record.correlation_key
        return None if key is None else np.asarray(self.arrays[key])

    @property
    def singular_values(self) -> NDArray[np.float64]:
        """Singular values of the scaled Jacobian, falling."""
        return np.array(self.record.singular_values)

    def _sentences(self) -> list[str]:
        of = f"{self.record.rank} of {len(self.record.column_labels)} combinations of parameters are determined"
        return [of, *self.record.sentences, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.parameters


@dataclass(frozen=True, eq=False, repr=False)
class QuantifyResult(StepResult):
    """Mean and covariance of the parameters from repeated tests.

    `record` is that of results.json, ``quantify``; `arrays` by its keys; `remarks` as those of the other steps.
    """

    record: QuantifyResults
    arrays: Arrays = field(repr=False)
    remarks: tuple[Notice, ...] = ()

    @property
    def ok(self) -> bool:
        """True if mean and covariance may be used."""
        return self.record.ok

    @property
    def parameters(self) -> Rows:
        """One line per free parameter: initial value, mean and standard deviation, in its unit."""
        return rows_of(self.record.parameters, "parameter", "start", "mean", "sd", "outside_bounds")

    @property
    def frequencies(self) -> Rows:
        """One line a compared frequency: mean and standard deviation of the repeats and of the model, in Hz."""
        columns = ("label", "repeats", "measured_mean_hz", "measured_sd_hz", "model_mean_hz", "model_sd_hz")
        return rows_of(self.record.outputs, *columns)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(parameters, parameters) covariance of the parameters, in their units."""
        return np.asarray(self.arrays[str(self.record.parameter_covariance_key)])

    @property
    def cloud(self) -> NDArray[np.float64]:
        """(samples, frequencies) frequencies of the updated distribution, in Hz."""
        return np.asarray(self.arrays[str(self.record.cloud_key)])

    @property
    def repeats(self) -> NDArray[np.float64]:
        """(repeats, frequencies) measured frequencies in Hz; NaN where one was not measured."""
        return np.asarray(self.arrays[str(self.record.repeats_key)])

    def _sentences(self) -> list[str]:
        r = self.record
        return [f"{r.status}, {r.repeats} repeats of {r.configuration}", *r.sentences, *map(str, self.remarks)]

    def _table(self) -> Rows:
        return self.parameters


@dataclass(frozen=True, eq=False, repr=False)
class RunResult(StepResult):
    """Results of an update, with its run folder.

    Parameters
    ----------
    folder : the run folder
    results : all records, as results.json has them
    arrays : by the keys that the records refer to
    report : the page that was written, None without one
    files : names of the files of the folder that the run has written; not known of a folder that is read
    """

    folder: Path
    results: Results
    arrays: Arrays
    report: Path | None = None
    files: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True where the update reached an optimum."""
        return self.results.update is not None and self.results.update.ok

    @property
    def status(self) -> str:
        """Name of the status: "CONVERGED"; "" where the run holds no update."""
        return "" if self.results.update is None else self.results.update.status

    @property
    def message(self) -> str:
        """The outcome of the update, in a sentence."""
        return "" if self.results.update is None else self.results.update.message

    @property
    def remarks(self) -> tuple[Notice, ...]:
        """Number of solutions from the journal of an earlier run."""
        journal = self.results.journal
        if journal is None:
            return ()
        from femtune.journal.journal import from_journal  # noqa: PLC0415

        return from_journal(journal.recalled, journal.solved)

    @property
    def values(self) -> dict[str, float]:
        """Updated value of each parameter, in its unit."""
        return {} if self.results.update is None else {p.name: p.value for p in self.results.update.parameters}

    @property
    def parameters(self) -> Rows:
        """One line per parameter: initial value, value, standard deviation, 95 % interval, change, bound."""
        if self.results.update is None:
            return Rows()
        facts = {p.name: p for p in self.results.parameters}
        columns = ("value", "sd", "change_percent", "interval_95", "interval_kind", "at_bound", "sd_reason")
        found = zip(self.results.update.parameters, rows_of(self.results.update.parameters, *columns))
        return Rows.of(
            {"name": p.name, "unit": facts[p.name].unit, "nominal": facts[p.name].nominal, **row} for p, row in found
        )

    @property
    def physical(self) -> Rows:
        """One line per field that a factor multiplies: unit, initial and updated value, 95 % interval."""
        if self.results.update is None:
            return Rows()
        columns = ("field", "unit", "nominal", "value", "interval_95")
        return Rows.of(
            {"name": p.name, **line} for p in self.results.update.parameters for line in rows_of(p.physical, *columns)
        )

    @property
    def derived(self) -> Rows:
        """One line a derived quantity of the study."""
        columns = ("name", "unit", "nominal", "value", "sd", "interval_95", "interval_kind", "sd_reason")
        return Rows() if self.results.update is None else rows_of(self.results.update.derived, *columns)

    @property
    def frequencies(self) -> Rows:
        """One line a test mode: frequency of the test, and of the model before and after, in Hz; errors in %; MAC."""
        before = {(p.configuration, p.test_label): p for p in self.before.pairs}
        after = {(p.configuration, p.test_label): p for p in self.after.pairs}
        found = []
        for key in dict.fromkeys([*before, *after]):
            old, new = before.get(key), after.get(key)
            some = old or new
            assert some is not None
            row = {"configuration": key[0], "test_label": key[1], "test_freq_hz": some.test_freq_hz}
            for word, pair in (("before", old), ("after", new)):
                row[f"{word}_hz"] = None if pair is None else pair.model_freq_hz
                row[f"{word}_error_percent"] = None if pair is None else pair.freq_error_percent
                row[f"{word}_mac"] = None if pair is None else pair.mac
            found.append(row)
        return Rows.of(found)

    @property
    def pairs(self) -> Rows:
        """Paired modes after the update, as `CorrelateResult.pairs`."""
        return self.after.pairs

    @property
    def history(self) -> Rows:
        """One line an iteration: weighted mean error in %, damping, and the value of each parameter."""
        update = self.results.update
        if update is None:
            return Rows()
        return Rows.of(
            {
                "iteration": i.iteration,
                "objective_percent": i.objective_percent,
                "damping": i.damping,
                **dict(zip(update.history_parameters, i.parameters)),
            }
            for i in update.history
        )

    @property
    def verdicts(self) -> Rows:
        """Acceptance criteria of the updated model; no rows if the study has no validation data."""
        columns = (
            "verdict", "criterion", "measured", "sense", "required", "unit", "configuration", "data", "remark", "noise",
        )  # fmt: skip
        found = self.results.validation
        return Rows() if found is None else rows_of(found.verdicts, *columns)

    @property
    def predictions(self) -> Rows:
        """Modes that the update did not use, with the predictions of the updated model."""
        columns = (
            "configuration", "test_label", "test_freq_hz", "model_number", "model_freq_hz", "freq_error_percent", "mac",
            "z", "remark",
        )  # fmt: skip
        found = self.results.validation
        return Rows() if found is None else rows_of(found.predictions, *columns)

    @property
    def alerts(self) -> Rows:
        """Alerts and remarks, the most important first."""
        return rows_of(self.results.alerts, "level", "code", "sentence", "where")

    @property
    def before(self) -> CorrelateResult:
        """Test against model at the initial values."""
        return self.at("before")

    @property
    def after(self) -> CorrelateResult:
        """Test against model with the values of the updated deck; without a deck those of the update."""
        written = any(c.stage == "after as written" for c in self.results.correlations)
        return self.at("after as written" if written else "after")

    def at(self, stage: ModelVersion) -> CorrelateResult:
        """Test against model at a stage: "before", "after" or "after as written"."""
        found = tuple(c for c in self.results.correlations if c.stage == stage)
        return CorrelateResult(found, arrays=self.arrays)

    @property
    def mac(self) -> NDArray[np.float64]:
        """(test modes, model modes) MAC after the update, of the only configuration."""
        return self.after.mac

    @property
    def selection(self) -> SelectResult | None:
        """Identifiability at the initial values; None if the run has none."""
        found = self.results.selection
        return None if found is None else SelectResult(found, self.arrays)

    @property
    def quantify(self) -> QuantifyResult | None:
        """Mean and covariance from repeated tests; None if the study has none."""
        found = self.results.quantify
        return None if found is None else QuantifyResult(found, self.arrays)

    @property
    def bootstrap(self) -> Rows:
        """One line per parameter: result, mean and spread of the bootstrap runs; no rows if the run has none."""
        columns = (
            "parameter", "value", "mean", "sd", "cov_percent", "bias", "linear_sd", "fisher_sd", "fisher_cov_percent",
            "interval_95", "at_bound_percent",
        )  # fmt: skip
        found = self.results.bootstrap
        return Rows() if found is None else rows_of(found.parameters, *columns)

    @property
    def specimens(self) -> Rows:
        """One line per parameter and specimen: joint and separate values; no rows if the study has no specimens."""
        found = self.results.specimens
        columns = ("specimen", "value", "sd", "separate_value", "separate_sd")
        records = () if found is None else found.parameters
        return Rows.of([{"parameter": p.name, **row} for p in records for row in rows_of(p.values, *columns)])

    @property
    def deck(self) -> Path | None:
        """The updated deck; None if none was written. Of specimens that of the first one."""
        written = self.results.write_back
        return None if written is None or not written.files else self.folder / written.files[0]

    def _sentences(self) -> list[str]:
        update = self.results.update
        if update is None:
            return [f"{self.results.study.title} in {self.folder}"]
        error = f"{update.objective_before_percent:.3g} to {update.objective_after_percent:.3g} %"
        head = f"{update.status}, weighted mean error {error}, {len(update.history) - 1} iterations, {self.folder}"
        found = []
        for p in update.parameters:
            sd = f", standard deviation {p.sd:.2g}" if p.sd is not None else f" ({p.sd_reason})"
            change = "" if p.change_percent is None else f", {p.change_percent:+.3g} %"
            found.append(f"{p.name} = {text_of(p.value)}{sd}{change}")
        problems = [f"{a.level}: {a.sentence}" for a in self.results.alerts if a.level == "problem"]
        return [head, *problems, *found]

    def _table(self) -> Rows:
        return self.parameters
