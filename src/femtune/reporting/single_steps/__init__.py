"""What the terminal shows of one step: documents from its records, with the tables of the report where they fit."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.reporting.single_steps.candidates import candidates_document
    from femtune.reporting.single_steps.correlate import correlation_document
    from femtune.reporting.single_steps.model import Subject, info_document, subject_of
    from femtune.reporting.single_steps.modes import modes_document, responses_document
    from femtune.reporting.single_steps.plan import plan_document
    from femtune.reporting.single_steps.screen import screen_document
    from femtune.reporting.single_steps.search import search_document
    from femtune.reporting.single_steps.select import selection_document
    from femtune.reporting.single_steps.validate import bootstrap_document, quantify_document, validation_document
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Subject",
    "bootstrap_document",
    "candidates_document",
    "correlation_document",
    "info_document",
    "modes_document",
    "plan_document",
    "quantify_document",
    "responses_document",
    "screen_document",
    "search_document",
    "selection_document",
    "subject_of",
    "validation_document",
]
