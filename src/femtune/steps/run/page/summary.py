"""Sections of the report: key numbers before and after, alerts, and the model at a glance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import Heading, KeyNumber, KeyNumbers, Paragraph
from femtune.document.numbers import (
    NONE,
    NOT_TESTED,
    as_sentence,
    counted,
    freq,
    listed,
    percent,
    signed_percent,
    unit_fraction,
    value,
    with_unit,
)
from femtune.steps.info.page import support_words
from femtune.steps.update.page.convergence import which_point
from femtune.steps.validate.page import goodness_sentence, outcome_sentence

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.info.record.model import ModelConfiguration, ModelModes
    from femtune.steps.report_source import ReportSource, Scores

_ORDER = ("problem", "warning")


def summary(source: ReportSource) -> list[Block]:
    """The numbers that a reader in a hurry looks at, the status of the update, and what must not be overlooked."""
    before, update = source.scores("before"), source.results.update
    after = source.scores(source.final_version)
    blocks: list[Block] = []
    if before:
        blocks = [KeyNumbers((*_objective(source), *_scores(before, after))), _meaning(source, before, after)]
    elif update is not None:
        blocks = [KeyNumbers(_objective(source))]
    if update is not None:
        blocks.append(Paragraph(f"Outcome of the update: {update.message}."))
        blocks += [Paragraph(text) for text in which_point(update)]
        # if it fails, an alert is given
        failed = update.goodness is not None and update.goodness.verdict == "fail"
        blocks += [] if failed else goodness_sentence(source)
    blocks += _validation(source)
    blocks += source.after_notes
    grave = [a for a in source.results.alerts if a.level in _ORDER]
    alerts = sorted(grave, key=lambda a: _ORDER.index(a.level))
    blocks += alert_boxes(alerts)
    return blocks if blocks else [Paragraph("Nothing has been compared.")]


def _objective(source: ReportSource) -> tuple[KeyNumber, ...]:
    update = source.results.update
    if update is None:
        return ()
    written = update.objective_as_written_percent
    final = update.objective_after_percent if written is None else written
    name = "Weighted mean error"
    return (KeyNumber(name, f"{percent(update.objective_before_percent)} %", f"{percent(final)} %"),)


def _meaning(source: ReportSource, before: Scores, after: Scores | None) -> Paragraph:
    """What each number is, and over which modes."""
    update = source.results.update
    counts = listed(counted(c.count, f"{c.kind} residual") for c in update.residual_counts) if update else ""
    fitted = (
        f"The weighted mean error is that of all residuals that the update compares{counts and f' ({counts})'}. "
        if update
        else ""
    )
    modes = f"{before.pairs} before, {after.pairs} after" if after else str(before.pairs)
    return Paragraph(
        f"{fitted}Frequency errors and MAC refer to all paired modes ({modes}), unweighted; means are of magnitudes.",
        "muted",
    )


def _scores(before: Scores, after: Scores | None) -> list[KeyNumber]:
    return [
        KeyNumber("Mean frequency error", _mean(before), _mean(after) if after else ""),
        KeyNumber(
            "Worst frequency error", _worst(before), _worst(after) if after else "", (after or before).worst_label
        ),
        KeyNumber(
            "Lowest MAC of a pair",
            unit_fraction(before.lowest_mac),
            unit_fraction(after.lowest_mac) if after else "",
            (after or before).lowest_label,
        ),
        KeyNumber("Paired modes", str(before.pairs), str(after.pairs) if after else ""),
    ]


def _mean(scores: Scores) -> str:
    return NOT_TESTED if scores.mean_error_percent is None else f"{percent(scores.mean_error_percent)} %"


def _worst(scores: Scores) -> str:
    return NOT_TESTED if scores.worst_error_percent is None else f"{signed_percent(scores.worst_error_percent)} %"


def _validation(source: ReportSource) -> list[Block]:
    """How the criteria came out on data that the update did not use."""
    validation = source.results.validation
    sentence = "" if validation is None else outcome_sentence(validation)
    if validation is None or not sentence:
        return []
    failed = any(v.verdict == "fail" for v in validation.verdicts)
    return [Paragraph(as_sentence(sentence), "poor" if failed else "good" if is_green(source) else "")]


def is_green(source: ReportSource) -> bool:
    """True unless the verdict on the run has a reservation: what passed alone must not look like the whole."""
    judged = source.results.judgement
    return judged is None or judged.verdict == "accepted"


_LOUD = ("problem", "warning")


def model_summary(source: ReportSource) -> list[Block]:
    """Numbers of each configuration, and the warnings of the reader."""
    model = source.results.model
    if model is None:
        return [Paragraph("The model was not built.")]
    several = len(model.configurations) > 1
    blocks: list[Block] = []
    for c in model.configurations:
        blocks += [Heading(c.configuration)] * several
        blocks.append(KeyNumbers(tuple(_numbers(source, c))))
    return blocks + alert_boxes(n for n in model.notices if n.level in _LOUD)


def _numbers(source: ReportSource, c: ModelConfiguration) -> list[KeyNumber]:
    modes = next((m for m in source.results.modes if m.configuration == c.configuration), None)
    units = source.results.study.units.split("-")
    mass_unit = units[1] if len(units) == 3 else ""
    check = c.rigid_body_check
    return [
        KeyNumber(
            "Mass",
            "not known" if c.mass is None else with_unit(value(c.mass), mass_unit),
            remark=f"{c.grids} grid points, {c.free_dofs} free DOFs",
        ),
        KeyNumber("Rigid-body check", check.verdict, remark=check.sentence),
        *([_modes(modes)] if modes else []),
        KeyNumber("Supports", support_words(c)[0], remark="; ".join([*_held(c), *c.constraints])),
    ]


def _held(c: ModelConfiguration) -> list[str]:
    """By what the model is held, and what no element stiffens."""
    words, loose = support_words(c)[1], len(c.held_dofs)
    return [*([words] if words else []), *([f"AUTOSPC: {counted(loose, 'DOF')}"] if loose else [])]


def _modes(m: ModelModes) -> KeyNumber:
    elastic = m.freq_hz[m.rigid_body_modes :]
    first = with_unit(freq(elastic[0]), "Hz") if elastic else NONE
    rigid = f", {m.rigid_body_modes} of them rigid-body modes" if m.rigid_body_modes else ""
    return KeyNumber("First elastic mode", first, remark=f"{len(m.freq_hz)} modes computed{rigid}")
