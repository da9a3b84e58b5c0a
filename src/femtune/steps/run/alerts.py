"""Alerts: remarks that the reader of the results should see first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from femtune.residuals.frf.antiresonance import AntiresonanceResidual
from femtune.residuals.frf.model_way import AtFirstState
from femtune.residuals.frf.residual import FrfResidual
from femtune.status import Status
from femtune.steps.info.checks import CENTRE, INERTIA, LUMPING, MASS, MESH
from femtune.steps.info.facts import alert_of
from femtune.steps.judge.same_data import counted_twice
from femtune.steps.quantify.record import HELD_OUT, ORDER, OUTLIERS
from femtune.steps.validate.facts import compares_frfs, responses_not_tested
from femtune.study.record import alert
from femtune.validation.goodness import Finding

if TYPE_CHECKING:
    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.steps.equalise.record import MappedDamping
    from femtune.steps.results import Results
    from femtune.steps.update.record.stages import StageResults
    from femtune.steps.update.record.update import PairingEvent, UpdateResults
    from femtune.steps.validate.record.validation import GoodnessResults
    from femtune.study.record import Alert
    from femtune.study.study import Study

_CHECKS = {
    **dict.fromkeys((MASS, CENTRE, INERTIA), "model.mass-differs"),
    LUMPING: "model.lumped-mass",
    MESH: "model.mesh-coarse",
}
_REPEAT_CHECKS = {
    ORDER: "quantify.order-dependence",
    OUTLIERS: "quantify.outlier/found",
    HELD_OUT: "quantify.held-out-differ",
}
_LARGE_DIFFERENCE_PERCENT = 0.05
"""Difference of the objective between the updated model and the written deck, in percentage points, above which an
alert is given. Rounding to the characters of a field usually causes less.
"""
FEWEST_SAMPLES = 1000
"""Effective number of samples below which intervals are not accurate: a quantile varies by 0.1 standard deviations."""
_MOST_UNPAIRED = 8
"""Unpaired test modes that are listed one by one, so that other alerts stay visible."""


_MISFITS = {
    Finding.SYSTEMATIC.name: "update.misfit/systematic",
    Finding.BOUNDED.name: "update.misfit/bounded",
}
"""Other wordings of the alert by finding."""


def alerts_of(study: Study, results: Results, others: Iterable[Alert] = ()) -> tuple[Alert, ...]:
    """Alerts of a finished run with `others` among them, the most serious first."""
    alerts = [
        *counted_twice(study),
        *_of_update(results),
        *_of_quantify(results),
        *_of_writing(results),
        *_of_model(results),
        *_of_modes(results),
        *_of_correlation(results),
        *_of_silent_modes(study),
        *_of_residuals(study),
        *_of_truncation(results),
        *_of_left_out_modes(results),
        *_of_frfs_alone(study, results),
        *_of_raw(results),
        *(told for mapped in results.mapped_damping for told in _of_completeness(mapped)),
        *(told for r in results.responses for told in r.alerts),
        *(() if results.posterior is None else results.posterior.alerts),
        *(alert_of(n) for n in study.built.notices if n.level != "info"),
        *(alert_of(n) for n in study.notices),
        *others,
    ]
    order = {"problem": 0, "warning": 1, "info": 2}
    return tuple(sorted(dict.fromkeys(alerts), key=lambda a: order[a.level]))


def _of_residuals(study: Study) -> Iterable[Alert]:
    """Notices on residuals that were left out when the comparisons were set up."""
    for case in study.cases:
        for residual in () if case.compared is None else case.compared.residuals:
            if isinstance(residual, AtFirstState):
                yield from map(alert_of, residual.notices)


def _of_truncation(results: Results) -> Iterable[Alert]:
    """FRFs of residuals that lack modes."""
    for truncation in () if results.update is None else results.update.frf_truncation:
        if not truncation.small:
            yield alert(
                "warning", "residual.frf-truncated", configuration=truncation.configuration, outcome=truncation.sentence
            )


def _of_left_out_modes(results: Results) -> Iterable[Alert]:
    """Modes that are left out of FRFs and changed their shapes."""
    for one in () if results.update is None else results.update.left_out_modes:
        if not one.resembles:
            yield alert(
                "warning", "residual.left-out-mode-lost", configuration=one.configuration, before=one.before,
                before_hz=one.before_hz, after=one.after, after_hz=one.after_hz, correlation=one.correlation,
            )  # fmt: skip


def _of_frfs_alone(study: Study, results: Results) -> Iterable[Alert]:
    """An update by FRFs alone looks as if damping and levels were tested by it."""
    update, validation = results.update, results.validation
    if update is None or validation is None or not compares_frfs(study):
        return
    if all(r.kind in (FrfResidual.label, AntiresonanceResidual.label) for r in update.residual_counts):
        missing = responses_not_tested(study, bool(validation.frfs), results.responses)
        if missing:
            yield alert("info", "update.frfs-alone", missing="; ".join(missing))


_MISFIT = 1.2
"""Residuals of measured FRFs over the noise that the identification has found, above which the model does not explain
them: 1 in 8 of 8 right models of a cantilever, 1 to 2.4 with a mass that is 2 or 10 % wrong."""
_MOVED = 3.0
"""Change by the measured FRFs, in standard deviations of the update with equal damping, that is no chance."""


def _of_raw(results: Results) -> Iterable[Alert]:
    """The update with measured FRFs after one with equal damping."""
    raw = None if results.update is None else results.update.raw
    if raw is None:
        return
    moved = {v.parameter: abs(v.moved) for v in raw.values if v.moved is not None}
    name = max(moved, key=lambda n: moved[n], default="")
    if moved:
        yield alert(
            "info", "update.raw", paired=raw.paired, median=raw.others_percent, moved=moved[name], name=name,
        )  # fmt: skip
    fisher = results.update.fisher if results.update is not None else None
    if fisher is not None and fisher.misfit <= _MISFIT:
        # only noise is left: what moved the parameters was an error of the identified test, which no longer counts
        return
    far = [n for n, size in moved.items() if size > _MOVED]
    if far:
        yield alert("warning", "update.raw-moved", names=", ".join(far), limit=_MOVED)
    if fisher is not None:
        yield alert("warning", "update.raw-misfit", factor=fisher.misfit)


def _of_completeness(mapped: MappedDamping) -> Iterable[Alert]:
    """Modes of the updated model, or of the identified test, that the other does not have."""
    yield from mapped.alerts
    missed = [m for m in mapped.modes if m.test_hz is None and m.seen_in]
    if missed:
        modes = "; ".join(
            f"mode {m.mode} of the model ({m.model_hz:.4g} Hz), which should be seen in {m.seen_in} FRFs, up to "
            f"{m.above_noise:.3g} times the noise"
            for m in missed
        )
        yield alert("warning", "update.mode-not-identified", configuration=mapped.configuration, modes=modes)
    guided = [m for m in mapped.modes if m.found_hz is not None]
    if guided:
        modes = ", ".join(f"mode {m.mode} ({m.model_hz:.4g} Hz; found at {m.found_hz:.4g} Hz)" for m in guided)
        yield alert("info", "update.mode-found", configuration=mapped.configuration, modes=modes)
    alone = [f"{m.test_hz:.4g} Hz" for m in mapped.modes if m.mode is None and m.test_hz is not None]
    if alone:
        facts = {"configuration": mapped.configuration, "modes": ", ".join(alone)}
        yield alert("warning", "update.mode-not-in-model", **facts)


def pairing_alerts(events: Sequence[PairingEvent]) -> Iterable[Alert]:
    if events:
        iterations = len({event.iteration for event in events})
        code = "update.pairing-changed" if iterations > 1 else "update.pairing-changed/once"
        yield alert("info", code, iterations=iterations, modes=len(events))
    merged = [f"{event.configuration}: {event.sentence}" for event in events if event.merged]
    if merged:
        yield alert("warning", "update.pairs-merged", pairs="; ".join(merged))


def _of_update(results: Results) -> Iterable[Alert]:
    update = results.update
    if update is None:
        return
    if not update.ok:
        yield alert("problem", "update.no-optimum", ending=update.message)
    if update.status == Status.UNDETERMINED.name:
        yield alert("warning", "update.undetermined")
    at_bound = [p.name for p in update.parameters if p.at_bound]
    if at_bound:
        yield alert("warning", "update.at-bound", parameters=", ".join(at_bound))
    if update.reduction is not None and not update.reduction.certified:
        yield alert("problem", "update.not-certified", last_round=update.reduction.rounds[-1])
    if update.weight_choice is not None and not update.weight_choice.found:
        yield alert("problem", "update.no-weight", reason=update.weight_choice.sentence)
    if update.starts is not None and not update.starts.unique:
        yield alert("warning", "update.not-unique", sentences=" ".join(update.starts.sentences))
    yield from pairing_alerts(update.pairing_events)
    yield from _of_intervals(update)
    yield from _of_stages(update.stages)
    if update.goodness is not None:
        yield from _of_goodness(update.goodness)


def _of_goodness(goodness: GoodnessResults) -> Iterable[Alert]:
    """Residuals that are no noise, and data too few to show what the model neglects."""
    if goodness.verdict == "fail":
        code = _MISFITS.get(goodness.finding, "update.misfit")
        yield alert("warning", code, outcome=goodness.sentence)
    if goodness.values is None or goodness.rank is None or not goodness.rank:
        return
    spare = goodness.values - goodness.rank
    if spare < goodness.rank:
        code = "update.few-data" if spare > 0 else "update.few-data/none-spare"
        yield alert("warning", code, values=goodness.values, rank=goodness.rank, spare=spare)


def _of_intervals(update: UpdateResults) -> Iterable[Alert]:
    if update.interval_samples is not None and update.interval_samples < FEWEST_SAMPLES:
        yield alert("warning", "update.few-samples", number=update.interval_samples)


def _of_stages(stages: Iterable[StageResults]) -> Iterable[Alert]:
    for stage in stages:
        if not stage.ok:
            yield alert("problem", "update.stage-unfinished", stage=stage.name, ending=stage.message)
        if stage.reduction is not None and not stage.reduction.certified:
            last = stage.reduction.rounds[-1]
            yield alert("problem", "update.not-certified/in-stage", stage=stage.name, last_round=last)
        apart = sum(not run.agrees for run in stage.runs)
        if apart:
            yield alert("warning", "update.starts-differ", stage=stage.name, apart=apart, starts=len(stage.runs))
        for misfit in stage.misfit:
            if misfit.larger_than_noise:
                facts = {"stage": stage.name, "kind": misfit.kind, "ratio": misfit.size}
                yield alert("warning", "update.stage-misfit", **facts)


def _of_quantify(results: Results) -> Iterable[Alert]:
    record = results.quantify
    if record is None:
        return
    if not record.ok:
        yield alert("problem", "quantify.no-distribution", ending=record.message)
    elif not record.agrees:
        yield alert("warning", "quantify.disagrees", outcome=record.sentences[0])
    for check in record.checks:
        if check.verdict == "fail":
            yield alert("warning", _REPEAT_CHECKS[check.check], found=check.sentence)


def _of_writing(results: Results) -> Iterable[Alert]:
    written, update = results.write_back, results.update
    if written is None or update is None:
        return
    for sentence in written.without_field:
        yield alert("info", "write.without-field", reason=sentence)
    if written.differences:
        yield alert("problem", "write.differs", difference="; ".join(written.differences))
        return
    as_written = update.objective_as_written_percent
    if as_written is not None and abs(as_written - update.objective_after_percent) > _LARGE_DIFFERENCE_PERCENT:
        errors = {"error_percent": as_written, "updated_percent": update.objective_after_percent}
        yield alert("warning", "write.rounding", **errors)


def _of_model(results: Results) -> Iterable[Alert]:
    if results.model is None:
        return
    for check in results.model_checks:
        if check.verdict == "fail":
            yield alert("warning", _CHECKS[check.check], configuration=check.configuration, found=check.sentence)
    for test in results.model.element_shapes.tests if results.model.element_shapes else ():
        if test.degenerate:
            worst = ", ".join(f"{e.card} {e.element}" for e in test.worst)
            yield alert("warning", "model.element-degenerate", count=test.beyond, test=test.test, worst=worst)
    for c in results.model.configurations:
        if c.rigid_body_check.verdict == "fail":
            sentence = c.rigid_body_check.sentence
            yield alert("warning", "model.grounded", configuration=c.configuration, found=sentence)


def _of_silent_modes(study: Study) -> Iterable[Alert]:
    """Measured modes that the update could use and that no residual compares."""
    for case in study.cases:
        if case.modal is None or case.entry.use != "update":
            continue
        if not any(r.of_modes for r in case.modal.residuals):
            yield alert("info", "residual.modes-unused", configuration=case.name)


def _of_correlation(results: Results) -> Iterable[Alert]:
    stages = [c.stage for c in results.correlations]
    for c in results.correlations:
        if stages and c.stage == stages[-1]:
            yield from _of_unpaired(c)
            yield from c.alerts


def _of_modes(results: Results) -> Iterable[Alert]:
    for m in results.modes:
        if m.stage == results.modes[-1].stage:
            yield from m.alerts


def _of_unpaired(c: CorrelationResults) -> Iterable[Alert]:
    for mode in c.unpaired_test[:_MOST_UNPAIRED]:
        facts = {"mode": mode.test_label, "reason": mode.reason}
        yield alert("warning", "correlate.unpaired", configuration=c.configuration, **facts)
    more = len(c.unpaired_test) - _MOST_UNPAIRED
    if more > 0:
        yield alert("warning", "correlate.unpaired/more", configuration=c.configuration, count=more)
