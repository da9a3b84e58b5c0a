"""From results to documents."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from femtune.document.document import Document, Paragraph, Section
from femtune.journal.run_files import DIGEST_FILE
from femtune.steps import all_steps, report_sections
from femtune.steps.report.approval import approval_of, document_facts
from femtune.steps.report.view import view_of
from femtune.steps.report_source import ReportSource
from femtune.steps.run.page.short_form import short_form, verdict
from femtune.steps.step import load
from femtune.study.model_source import FromDeck, ModelSource

if TYPE_CHECKING:
    from femtune.document.document import Approval, Block
    from femtune.steps.results import Results
    from femtune.steps.step import Page, ReportSection
    from femtune.study.record import InputFile, StudyFacts


def build_report(results: Results, arrays: Mapping[str, NDArray[Any]], files: Iterable[InputFile] = ()) -> Document:
    """The report of a run as data; `arrays` by the keys that `results` refers to, `files` are those of the run folder.

    Sections whose data are absent say so. Pictures are drawn when a renderer asks for them.
    """
    source = ReportSource(results, arrays)
    sentence, level = verdict(source)
    sections = tuple(_section(_titled(section, results.study), source) for section in report_sections())
    return Document(
        results.study.title, sentence, level, _facts(results), sections, short_form(source),
        collect=partial(view_of, source), approval=_approval(results, files),
    )  # fmt: skip


def build_page(record: str, results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """The page of the step whose record is that field of the results; sections without content are left out."""
    page, source = pages()[record], ReportSource(results, arrays)
    sentence, level = load(page.verdict)(getattr(results, record))
    sections = tuple(made for section in page.sections if (made := _section(section, source)).blocks)
    return Document(
        results.study.title, sentence, level, _facts(results), sections, genre=page.genre,
        collect=partial(view_of, source), approval=_approval(results, ()),
    )  # fmt: skip


def pages() -> dict[str, Page]:
    """Pages of the steps that run alone, by the field of the results that has the record of the step."""
    return {step.page.record: step.page for step in all_steps() if step.page is not None}


def _titled(section: ReportSection, study: StudyFacts) -> ReportSection:
    """Where no deck is changed, the values are for whoever made the model."""
    if study.has_deck or section.id != "write_back":
        return section
    return replace(section, title="Values for the other solver")


def _section(section: ReportSection, source: ReportSource) -> Section:
    """The section with the blocks of its function; one that only says why it is empty has no opening words."""
    blocks: list[Block] = load(section.blocks)(source)
    folded = section.optional and len(blocks) == 1 and isinstance(blocks[0], Paragraph)
    empty = folded or (section.optional and not blocks)
    intro = (Paragraph(section.intro, tone="muted"),) if section.intro and not empty else ()
    return Section(section.id, section.title, (*intro, *blocks), folded)


def _facts(results: Results) -> tuple[tuple[str, str], ...]:
    study, origin = results.study, results.provenance
    return (
        *document_facts(study.report),
        ((FromDeck if study.has_deck else ModelSource).title, study.deck_file),
        ("Configurations", ", ".join(study.configurations)),
        ("Units", study.units or "those of the deck (none are declared)"),
        ("Run", f"{origin.started_at}, femtune {origin.femtune_version}"),
    )


def _approval(results: Results, files: Iterable[InputFile]) -> Approval:
    origin = results.provenance
    return approval_of(results.study.report, (origin.study_file, *origin.input_files), files, DIGEST_FILE)
