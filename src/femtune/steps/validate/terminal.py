"""Repeated tests, bootstrap and validation on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import AlertBox, Listing, Paragraph, Section
from femtune.document.numbers import NOT_TESTED, as_sentence
from femtune.steps.bootstrap.page import bootstrap_blocks
from femtune.steps.quantify.page import (
    check_tables,
    entry_tables,
    interval_blocks,
    output_table,
    parameter_table,
    variability_blocks,
)
from femtune.steps.validate.page import (
    outcome_sentence,
    prediction_blocks,
    sensor_blocks,
    untested_reasons,
    validation_verdicts,
)
from femtune.steps.validate.record.validation import ValidationResults

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.info.terminal import Subject
    from femtune.steps.quantify.record import QuantifyResults
    from femtune.steps.results import Results


def quantify_document(subject: Subject, found: QuantifyResults) -> Document:
    """The verdict is the first sentence."""
    first, *_ = found.sentences
    failed = any(c.verdict == "fail" for c in found.checks)
    level: Level = "info" if found.ok and found.agrees and not failed else "warning"
    words = tuple(b for b in variability_blocks(found)[1:] if isinstance(b, Listing))
    how = next(b for b in variability_blocks(found)[1:] if isinstance(b, Paragraph))
    sections = (
        Section("words", "Reliability", words),
        Section("parameters", "Variability of the parameters", (how, parameter_table(found))),
        Section("outputs", "Forward check", (output_table(found), *entry_tables(found))),
        *(Section("checks", "Tests of the repeats", (table,)) for table in check_tables(found)),
        *([Section("intervals", "Intervals", tuple(interval_blocks(found)))] if found.intervals else []),
    )
    return subject.document(first, level, sections)


def bootstrap_document(subject: Subject, results: Results) -> Document:
    """The first sentence, or why there is no bootstrap."""
    found = results.bootstrap
    if found is None:
        reasons = [a.sentence for a in results.alerts if a.code.startswith(("bootstrap.", "executor."))]
        return subject.document(as_sentence((reasons or ["there was no bootstrap"])[0]), "problem", ())
    sections = (Section("bootstrap", "Bootstrap", tuple(bootstrap_blocks(found))), *_warnings(results))
    warned = any(a.code.startswith("bootstrap.") and a.level != "info" for a in results.alerts)
    level: Level = "info" if found.converged == found.runs and not warned else "warning"
    return subject.document(found.sentences[0], level, sections)


def _warnings(results: Results) -> tuple[Section, ...]:
    """Warnings on deck, test and update, as in the summary of a report."""
    boxes = tuple(AlertBox(a.level, a.code, a.sentence, a.where) for a in results.alerts if a.level != "info")
    return (Section("warnings", "Warnings", boxes),) if boxes else ()


_NOTHING = "no data were held out of the update, so that the quality of predictions was not tested"


def validation_document(subject: Subject, results: Results) -> Document:
    """Verdicts, predictions, held-out sensors, whether the residuals of the update are noise, what was not tested."""
    found = results.validation or ValidationResults(predictions=(), not_tested=())
    sentence = outcome_sentence(found) or _NOTHING
    sections = (
        Section("verdicts", "Verdicts", tuple(validation_verdicts(found)[1:])),
        Section("predictions", "Predictions", tuple(_predictions(found))),
        Section("sensors", "Held-out sensors", tuple(sensor_blocks(found))),
        Section("residuals", "Residuals of the update", tuple(_residuals(results))),
        Section("open", "What was not tested", (Listing((*untested_reasons(found), *found.not_tested)),)),
        *_warnings(results),
    )
    return subject.document(as_sentence(sentence), _level(found), sections)


def _predictions(found: ValidationResults) -> list[Block]:
    return prediction_blocks(found, []) if found.predictions else []


def _residuals(results: Results) -> list[Block]:
    update = results.update
    if update is None or update.goodness is None:
        return []
    return [Paragraph(as_sentence(update.goodness.sentence), "poor" if update.goodness.verdict == "fail" else "")]


def _level(found: ValidationResults) -> Level:
    words = {v.verdict for v in found.verdicts}
    return "problem" if "fail" in words else "info" if words - {NOT_TESTED} else "warning"
