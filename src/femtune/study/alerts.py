"""Alerts: what the reader of the results should know first."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from femtune.model import grid_matrix
from femtune.residuals import OfPairs
from femtune.residuals.at_first_state import AtFirstState
from femtune.residuals.dynamic import DynamicResidual
from femtune.status import Status
from femtune.study.load import Study
from femtune.study.record_checks import LUMPING, MASS, MESH
from femtune.study.record_model import alert_of
from femtune.study.results import Results
from femtune.study.results_base import Alert, Level
from femtune.study.results_correlation import CorrelationResults
from femtune.study.results_stages import StageResults

_CHECKS = {MASS: "model.mass-differs", LUMPING: "model.lumped-mass", MESH: "model.mesh-coarse"}
_WRITTEN_PERCENT = 0.05
_MISFIT = "the model lacks something, another minimum fits better, or the scatter is stated too small"
_MOST_UNPAIRED = 8


def alerts_of(study: Study, results: Results, others: Iterable[Alert] = ()) -> tuple[Alert, ...]:
    """Alerts of a finished run with `others` among them, the gravest first."""
    found = [
        *_of_update(results),
        *_of_quantify(results),
        *_of_writing(results),
        *_of_model(results),
        *_of_correlation(results),
        *_of_held_masses(study),
        *_of_silent_modes(study),
        *_of_residuals(study),
        *(alert for r in results.responses for alert in r.alerts),
        *(alert_of(n) for n in study.built.notices if n.level != "info"),
        *(alert_of(n) for n in study.notices),
        *others,
    ]
    order = {"problem": 0, "warning": 1, "info": 2}
    return tuple(sorted(dict.fromkeys(found), key=lambda a: order[a.level]))


def _of_residuals(study: Study) -> Iterable[Alert]:
    """What comparisons left out when they were settled."""
    for case in study.cases:
        for residual in () if case.compared is None else case.compared.residuals:
            if isinstance(residual, AtFirstState):
                yield from map(alert_of, residual.notices)


def _alert(level: Level, code: str, sentence: str) -> Alert:
    return Alert(level=level, code=code, sentence=sentence)


def _of_update(results: Results) -> Iterable[Alert]:
    update = results.update
    if update is None:
        return
    if not update.ok:
        yield _alert("problem", "update.no-optimum", f"the update {update.message}")
    if update.status == Status.UNDETERMINED.name:
        yield _alert("warning", "update.undetermined", "some combinations of parameters are not determined by the data")
    at_bound = [p.name for p in update.parameters if p.at_bound]
    if at_bound:
        yield _alert(
            "warning", "update.at-bound", f"at a bound, so that their values say little: {', '.join(at_bound)}"
        )
    if update.reduction is not None and not update.reduction.certified:
        sentence = f"the reduced models are not certified: {update.reduction.rounds[-1]}"
        yield _alert("problem", "update.not-certified", sentence)
    if update.weight_choice is not None and not update.weight_choice.found:
        yield _alert("problem", "update.no-weight", update.weight_choice.sentence)
    if update.starts is not None and not update.starts.unique:
        yield _alert("warning", "update.not-unique", " ".join(update.starts.sentences))
    if update.pairing_events:
        turns = len({event.iteration for event in update.pairing_events})
        count = f"{turns} iteration{'s' if turns > 1 else ''} ({len(update.pairing_events)} test modes in all)"
        yield _alert("info", "update.pairing-changed", f"the pairing changed in {count}")
    yield from _of_stages(update.stages)
    if update.goodness is not None and update.goodness.verdict == "fail":
        yield _alert("warning", "update.misfit", f"{update.goodness.sentence}; {_MISFIT}")


def _of_stages(stages: Iterable[StageResults]) -> Iterable[Alert]:
    for stage in stages:
        if not stage.ok:
            yield _alert("problem", "update.stage-unfinished", f"stage {stage.name}: {stage.message}")
        apart = sum(not run.agrees for run in stage.runs)
        if apart:
            what = f"stage {stage.name}: {apart} of {len(stage.runs)} starts do not end in the same optimum"
            yield _alert("warning", "update.starts-differ", what)
        for misfit in stage.misfit:
            if misfit.larger_than_noise:
                what = f"stage {stage.name}: its {misfit.kind} residuals are {misfit.size:.2f} times what noise and the"
                yield _alert("warning", "update.stage-misfit", f"{what} parameters that rest explain; {_MISFIT}")


def _of_quantify(results: Results) -> Iterable[Alert]:
    found = results.quantify
    if found is None:
        return
    if not found.ok:
        yield _alert("problem", "quantify.no-distribution", f"the scatter of the parameters: {found.message}")
    elif not found.agrees:
        yield _alert("warning", "quantify.disagrees", found.sentences[0])


def _of_writing(results: Results) -> Iterable[Alert]:
    written, update = results.write_back, results.update
    if written is None or update is None:
        return
    lost = [s for s in written.without_field if "split = true" in s or "no card holds" in s]
    for sentence in written.without_field:
        yield _alert("warning" if sentence in lost else "info", "write.without-field", sentence)
    as_written = update.objective_as_written_percent
    if as_written is not None and abs(as_written - update.objective_after_percent) > _WRITTEN_PERCENT:
        errors = f"a weighted mean error of {as_written:.3g} % instead of {update.objective_after_percent:.3g} %"
        if lost:
            yield _alert(
                "warning", "write.incomplete", f"without the values that were not written the deck has {errors}"
            )
        else:
            hint = "wide = true keeps more digits"
            yield _alert(
                "warning", "write.rounding", f"the values that the deck's fields can hold give {errors}; {hint}"
            )


def _of_model(results: Results) -> Iterable[Alert]:
    if results.model is None:
        return
    for check in results.model_checks:
        if check.verdict == "fail":
            yield _alert("warning", _CHECKS[check.check], f"{check.configuration}: {check.sentence}")
    for c in results.model.configurations:
        if c.rigid_body_check.verdict == "fail":
            yield _alert("warning", "model.grounded", f"{c.configuration}: {c.rigid_body_check.sentence}")


def _of_held_masses(study: Study) -> Iterable[Alert]:
    """Masses on points that nothing stiffens: AUTOSPC holds them, so that they take part in no mode."""
    for case in study.cases:
        held = [d for d in case.configured.held_singular if 1 <= d.component <= 3]
        mass = grid_matrix(study.model, case.configured.configuration, "mass").diagonal() if held else np.zeros(0)
        heavy = [str(d)[:-1] for d in held if mass[study.model.structure.nodes.dof(d.node, d.component)] > 0.0]
        if heavy:
            shown = ", ".join(heavy[:6]) + (" …" if len(heavy) > 6 else "")
            sentence = f"{case.name}: nothing stiffens {shown}, so AUTOSPC holds the mass there and it moves in no mode"
            yield _alert("warning", "model.held-mass", sentence)


def _of_silent_modes(study: Study) -> Iterable[Alert]:
    """Measured modes that the update could use and that no residual compares."""
    for case in study.cases:
        if case.modal is None or case.entry.use != "update" or study.rules.compare_modes:
            continue
        if not any(isinstance(r, OfPairs | DynamicResidual) for r in case.modal.residuals):
            sentence = f"{case.name}: the test has modes, and no residual of the study compares them"
            yield _alert("info", "residual.modes-unused", sentence)


def _of_correlation(results: Results) -> Iterable[Alert]:
    stages = [c.stage for c in results.correlations]
    for c in results.correlations:
        if stages and c.stage == stages[-1]:
            yield from _of_unpaired(c)


def _of_unpaired(c: CorrelationResults) -> Iterable[Alert]:
    for mode in c.unpaired_test[:_MOST_UNPAIRED]:
        yield _alert("warning", "correlate.unpaired", f"{c.configuration}: test mode {mode.test_label}: {mode.reason}")
    more = len(c.unpaired_test) - _MOST_UNPAIRED
    if more > 0:
        sentence = f"{c.configuration}: {more} more test modes have no partner; the table of modes gives the reasons"
        yield _alert("warning", "correlate.unpaired", sentence)
