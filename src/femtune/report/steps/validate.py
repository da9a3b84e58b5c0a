"""The updated model on data that the update did not use."""

from __future__ import annotations

from femtune.report.document import Block, Document, Level, Listing, Paragraph, Section
from femtune.report.numbers import NOT_TESTED
from femtune.report.sections.validation import (
    outcome_sentence,
    prediction_blocks,
    sensor_blocks,
    untested_reasons,
    validation_verdicts,
)
from femtune.report.steps.subject import Subject
from femtune.study.results import Results
from femtune.study.results_validation import ValidationResults

_NOTHING = "nothing was kept from the update, so that how well the model predicts was not tested"


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
    )
    return subject.document(f"{sentence[0].upper()}{sentence[1:]}.", _level(found), sections)


def _predictions(found: ValidationResults) -> list[Block]:
    return prediction_blocks(found, []) if found.predictions else []


def _residuals(results: Results) -> list[Block]:
    update = results.update
    if update is None or update.goodness is None:
        return []
    return [Paragraph(f"{update.goodness.sentence}.", "poor" if update.goodness.verdict == "fail" else "")]


def _level(found: ValidationResults) -> Level:
    words = {v.verdict for v in found.verdicts}
    return "problem" if "fail" in words else "info" if words - {NOT_TESTED} else "warning"
