"""From results to documents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from femtune.reporting.document import Document, Paragraph, Section
from femtune.reporting.html import section_texts
from femtune.reporting.short_form import (
    candidates_verdict,
    plan_verdict,
    responses_verdict,
    screen_verdict,
    search_verdict,
    short_form,
    sturm_verdict,
    verdict,
)
from femtune.reporting.source import ReportSource

if TYPE_CHECKING:
    from femtune.reporting.document import Block
    from femtune.reporting.html import SectionText
    from femtune.results.results import Results


def build_report(results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """The report of a run as data; `arrays` by the keys that `results` refers to.

    Sections whose data are absent say so. Pictures are drawn when a renderer asks for them.
    """
    source = ReportSource(results, arrays)
    sentence, level = verdict(source)
    texts = [_titled(text, results.study.imported) for text in section_texts()]
    sections = tuple(_section(text, source) for text in texts)
    return Document(results.study.title, sentence, level, _facts(results), sections, short_form(source))


def build_modes_page(results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """The modes of a model as data, with a picture of each: for results that hold no comparison with a test."""
    source = ReportSource(results, arrays)
    sentence, level = sturm_verdict(results.modes)
    sections = tuple(_section(text, source) for text in section_texts("modes"))
    return Document(results.study.title, sentence, level, _facts(results), sections, genre="Natural modes")


def build_responses_page(results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """Responses of a model as data: functions with pictures, complex modes, static loads."""
    source = ReportSource(results, arrays)
    sentence, level = responses_verdict(results.responses)
    found = (_section(text, source) for text in section_texts("responses"))
    sections = tuple(s for s in found if s.blocks)
    return Document(results.study.title, sentence, level, _facts(results), sections, genre="Responses")


def build_plan_page(results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """A planned test as data: sensors with a picture, target modes, provenance."""
    source = ReportSource(results, arrays)
    assert results.plan is not None
    sentence, level = plan_verdict(results.plan)
    sections = tuple(_section(text, source) for text in section_texts("plan"))
    return Document(results.study.title, sentence, level, _facts(results), sections, genre="Test plan")


def build_screen_page(results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """A screening as data: effects, modes, provenance."""
    source = ReportSource(results, arrays)
    assert results.screen is not None
    sentence, level = screen_verdict(results.screen)
    sections = tuple(_section(text, source) for text in section_texts("screen"))
    return Document(results.study.title, sentence, level, _facts(results), sections, genre="Screening of parameters")


def build_search_page(results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """A search of the whole box as data: parameters, convergence, surrogate, provenance."""
    source = ReportSource(results, arrays)
    assert results.search is not None
    sentence, level = search_verdict(results.search)
    found = (_section(text, source) for text in section_texts("search"))
    sections = tuple(s for s in found if s.blocks)
    return Document(results.study.title, sentence, level, _facts(results), sections, genre="Global search")


def build_candidates_page(results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """Candidate models as data: criteria, parameters, distances, provenance."""
    source = ReportSource(results, arrays)
    assert results.candidates is not None
    sentence, level = candidates_verdict(results.candidates)
    sections = tuple(_section(text, source) for text in section_texts("candidates"))
    return Document(results.study.title, sentence, level, _facts(results), sections, genre="Candidate models")


def _titled(text: SectionText, imported: bool) -> SectionText:
    """A model of matrices has no deck that could be changed."""
    return replace(text, title="Values for the other solver") if imported and text.id == "write_back" else text


def _section(text: SectionText, source: ReportSource) -> Section:
    """The section that the function `text.id` of its module makes."""
    blocks: list[Block] = getattr(import_module(f"femtune.reporting.sections.{text.module}"), text.id)(source)
    intro = (Paragraph(text.intro, tone="muted"),) if text.intro else ()
    return Section(text.id, text.title, (*intro, *blocks))


def _facts(results: Results) -> tuple[tuple[str, str], ...]:
    study, origin = results.study, results.provenance
    return (
        ("Matrices of" if study.imported else "Deck", study.deck_file),
        ("Configurations", ", ".join(study.configurations)),
        ("Units", study.units or "those of the deck (none are declared)"),
        ("Run", f"{origin.started_at}, femtune {origin.femtune_version}"),
    )
