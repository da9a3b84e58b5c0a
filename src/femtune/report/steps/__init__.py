"""What the terminal shows of one step: documents from its records, with the tables of the report where they fit."""

from femtune.report.steps.correlate import correlation_document
from femtune.report.steps.info import info_document
from femtune.report.steps.modes import modes_document
from femtune.report.steps.quantify import quantify_document
from femtune.report.steps.respond import responses_document
from femtune.report.steps.select import selection_document
from femtune.report.steps.subject import Subject, subject_of
from femtune.report.steps.validate import validation_document

__all__ = [
    "Subject",
    "correlation_document",
    "info_document",
    "modes_document",
    "quantify_document",
    "responses_document",
    "selection_document",
    "subject_of",
    "validation_document",
]
