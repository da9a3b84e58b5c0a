"""The outcome in one sentence."""

from __future__ import annotations

from collections.abc import Sequence

from femtune.report.document import Level
from femtune.report.numbers import counted, listed, percent, unit_fraction
from femtune.report.source import Scores, Source
from femtune.study.results_model import ModelModes
from femtune.study.results_response import ResponseResults
from femtune.study.results_update import UpdateResults


def verdict(source: Source) -> tuple[str, Level]:
    """One sentence and how serious it is."""
    update, before, after = source.results.update, source.scores("before"), source.scores(source.final_stage)
    if before is None:
        return _without_modes(source, update)
    if update is None or after is None:
        return f"Test and model were compared, no update was run: {agreement(before)}.", "info"
    if not update.ok:
        return (
            f"The update did not reach an optimum ({update.message}); its best point: {agreement(after)}.",
            "problem",
        )
    caveats = _caveats(source, update)
    sentence = f"After the update {agreement(after)} (before: {_numbers(before)}){_tail(caveats)}."
    return sentence, "warning" if caveats else "info"


def _without_modes(source: Source, update: UpdateResults | None) -> tuple[str, Level]:
    """Where no modes were measured the weighted mean error is all that there is."""
    if update is None:
        return "Test and model have not been compared.", "warning"
    first, last = percent(update.objective_before_percent), percent(update.objective_after_percent)
    if not update.ok:
        return f"The update did not reach an optimum ({update.message}); weighted mean error {last} %.", "problem"
    caveats = _caveats(source, update)
    sentence = f"After the update the weighted mean error is {last} % (before: {first} %){_tail(caveats)}."
    return sentence, "warning" if caveats else "info"


def sturm_verdict(modes: Sequence[ModelModes]) -> tuple[str, Level]:
    """Whether a mode was missed, in one sentence."""
    untested = [m.configuration for m in modes if m.sturm_count is None]
    missed = [m.configuration for m in modes if m.sturm_count is not None and m.sturm_count != m.modes_below_shift]
    if missed:
        return f"Counts of modes differ in {listed(missed)}: a mode may have been missed.", "problem"
    if untested:
        return f"Whether a mode was missed was not tested in {listed(untested)}.", "warning"
    return "No mode was missed: the Sturm counts agree.", "info"


def responses_verdict(found: Sequence[ResponseResults]) -> tuple[str, Level]:
    """How many responses there are, and whether something damps them."""
    functions = sum(len(r.frfs.pairs) for r in found if r.frfs is not None)
    loads = sum(len(r.loads) for r in found)
    parts = [counted(functions, "frequency response")] if functions else []
    parts += [counted(loads, "load case")] if loads else []
    what = " and ".join(parts)
    if any(a.code == "response.undamped" for r in found for a in r.alerts):
        return f"{what}; nothing damps the model.", "warning"
    return f"{what}.", "info"


def agreement(scores: Scores) -> str:
    """How well paired modes agree, without a full stop."""
    if not scores.pairs:
        return "no test mode could be paired with a model mode"
    return f"{counted(scores.pairs, 'test mode')} and model agree within {_numbers(scores)}"


def _numbers(scores: Scores) -> str:
    if scores.mean_error_percent is None:
        return "no pairs"
    mac = f", lowest MAC {unit_fraction(scores.lowest_mac)}" if scores.lowest_mac is not None else ""
    return f"{percent(scores.mean_error_percent)} % mean frequency error{mac}"


def _tail(caveats: list[str]) -> str:
    return f"; {' and '.join(caveats)}" if caveats else ""


def _caveats(source: Source, update: UpdateResults) -> list[str]:
    """What must be said in the same breath as the success."""
    at_bound = sum(bool(p.at_bound) for p in update.parameters)
    open_ = len(source.results.selection.undetermined) if source.results.selection else 0
    return [
        *([f"{counted(at_bound, 'parameter')} ended at a bound"] if at_bound else []),
        *([f"the data leave {counted(open_, 'combination')} of parameters undetermined"] if open_ else []),
        *(["the residuals are not noise"] if update.goodness and update.goodness.verdict == "fail" else []),
        *_failed(source),
    ]


def _failed(source: Source) -> list[str]:
    """That criteria failed on data that were not used."""
    verdicts = source.results.validation.verdicts if source.results.validation else ()
    failed = sum(v.verdict == "fail" for v in verdicts)
    return [f"{counted(failed, 'criterion', 'criteria')} failed on data that were not used"] if failed else []
