"""The result of `update`, `validate`, `bootstrap`, `run` and `read_results`: the content of a run folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.study.rows import Rows, rows_of, text_of

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.steps.results import Results
    from femtune.study.record import ModelVersion
from femtune.steps.correlate.result import CorrelateResult
from femtune.steps.quantify.result import QuantifyResult
from femtune.steps.result import Arrays, StepResult
from femtune.steps.select.result import SelectResult


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
        rows = zip(self.results.update.parameters, rows_of(self.results.update.parameters, *columns))
        return Rows.of(
            {"name": p.name, "unit": facts[p.name].unit, "nominal": facts[p.name].nominal, **row} for p, row in rows
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
        rows = []
        for key in dict.fromkeys([*before, *after]):
            old, new = before.get(key), after.get(key)
            some = old or new
            assert some is not None
            row = {"configuration": key[0], "test_label": key[1], "test_freq_hz": some.test_freq_hz}
            for word, pair in (("before", old), ("after", new)):
                row[f"{word}_hz"] = None if pair is None else pair.model_freq_hz
                row[f"{word}_error_percent"] = None if pair is None else pair.freq_error_percent
                row[f"{word}_mac"] = None if pair is None else pair.mac
            rows.append(row)
        return Rows.of(rows)

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
        validation = self.results.validation
        return Rows() if validation is None else rows_of(validation.verdicts, *columns)

    @property
    def predictions(self) -> Rows:
        """Modes that the update did not use, with the predictions of the updated model."""
        columns = (
            "configuration", "test_label", "test_freq_hz", "model_number", "model_freq_hz", "freq_error_percent", "mac",
            "z", "remark",
        )  # fmt: skip
        validation = self.results.validation
        return Rows() if validation is None else rows_of(validation.predictions, *columns)

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
        correlations = tuple(c for c in self.results.correlations if c.stage == stage)
        return CorrelateResult(correlations, arrays=self.arrays)

    @property
    def mac(self) -> NDArray[np.float64]:
        """(test modes, model modes) MAC after the update, of the only configuration."""
        return self.after.mac

    @property
    def selection(self) -> SelectResult | None:
        """Identifiability at the initial values; None if the run has none."""
        selection = self.results.selection
        return None if selection is None else SelectResult(selection, self.arrays)

    @property
    def quantify(self) -> QuantifyResult | None:
        """Mean and covariance from repeated tests; None if the study has none."""
        quantify = self.results.quantify
        return None if quantify is None else QuantifyResult(quantify, self.arrays)

    @property
    def bootstrap(self) -> Rows:
        """One line per parameter: result, mean and spread of the bootstrap runs; no rows if the run has none."""
        columns = (
            "parameter", "value", "mean", "sd", "cov_percent", "bias", "linear_sd", "fisher_sd", "fisher_cov_percent",
            "interval_95", "at_bound_percent",
        )  # fmt: skip
        bootstrap = self.results.bootstrap
        return Rows() if bootstrap is None else rows_of(bootstrap.parameters, *columns)

    @property
    def posterior(self) -> Rows:
        """One line per parameter: its sampled distribution beside the linear one; no rows if the run has none."""
        columns = (
            "parameter", "value", "mean", "median", "sd", "interval_95", "linear_interval_95", "update_interval_95",
            "of_bounds",
        )  # fmt: skip
        posterior = self.results.posterior
        return Rows() if posterior is None else rows_of(posterior.parameters, *columns)

    @property
    def specimens(self) -> Rows:
        """One line per parameter and specimen: joint and separate values; no rows if the study has no specimens."""
        specimens = self.results.specimens
        columns = ("specimen", "value", "sd", "separate_value", "separate_sd")
        records = () if specimens is None else specimens.parameters
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
        sentences = []
        for p in update.parameters:
            sd = f", standard deviation {p.sd:.2g}" if p.sd is not None else f" ({p.sd_reason})"
            change = "" if p.change_percent is None else f", {p.change_percent:+.3g} %"
            sentences.append(f"{p.name} = {text_of(p.value)}{sd}{change}")
        problems = [f"{a.level}: {a.sentence}" for a in self.results.alerts if a.level == "problem"]
        return [head, *problems, *sentences]

    def _table(self) -> Rows:
        return self.parameters
