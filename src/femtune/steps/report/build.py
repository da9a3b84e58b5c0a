"""From results to documents."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from femtune.document.document import Document, Paragraph, Section
from femtune.steps.report.view import view_of
from femtune.steps.report_source import ReportSource
from femtune.steps.run.page.short_form import (
    candidates_verdict,
    plan_verdict,
    responses_verdict,
    screen_verdict,
    search_verdict,
    short_form,
    sturm_verdict,
    verdict,
)
from femtune.study.model_source import FromDeck, ModelSource

if TYPE_CHECKING:
    from femtune.document.document import Block, Level
    from femtune.steps.results import Results
    from femtune.study.record import StudyFacts


def build_report(results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """The report of a run as data; `arrays` by the keys that `results` refers to.

    Sections whose data are absent say so. Pictures are drawn when a renderer asks for them.
    """
    source = ReportSource(results, arrays)
    sentence, level = verdict(source)
    texts = [_titled(text, results.study) for text in section_texts()]
    sections = tuple(_section(text, source) for text in texts)
    facts, short = _facts(results), short_form(source)
    return Document(results.study.title, sentence, level, facts, sections, short, collect=partial(view_of, source))


@dataclass(frozen=True)
class StepPage:
    """The page of a step.

    Parameters
    ----------
    genre : what the page is, in words
    verdict : sentence and level, from the record of the step
    """

    genre: str
    verdict: Callable[[Any], tuple[str, Level]]


PAGES = {
    "modes": StepPage("Natural modes", sturm_verdict),
    "responses": StepPage("Responses", responses_verdict),
    "plan": StepPage("Test plan", plan_verdict),
    "screen": StepPage("Screening of parameters", screen_verdict),
    "search": StepPage("Global search", search_verdict),
    "candidates": StepPage("Candidate models", candidates_verdict),
}
"""Pages of single steps, by the field of the results that has the record of the step."""


def build_page(step: str, results: Results, arrays: Mapping[str, NDArray[Any]]) -> Document:
    """The page of a step of `PAGES` as data; sections without content are left out."""
    page, source = PAGES[step], ReportSource(results, arrays)
    sentence, level = page.verdict(getattr(results, step))
    found = (_section(text, source) for text in section_texts(step))
    sections = tuple(s for s in found if s.blocks)
    facts, collect = _facts(results), partial(view_of, source)
    return Document(results.study.title, sentence, level, facts, sections, genre=page.genre, collect=collect)


def _titled(text: SectionText, study: StudyFacts) -> SectionText:
    """Where no deck is changed, the values are for whoever made the model."""
    if study.has_deck or text.id != "write_back":
        return text
    return replace(text, title="Values for the other solver")


def _section(text: SectionText, source: ReportSource) -> Section:
    """The section that a function of its module makes; one that only says why it is empty has no opening words."""
    module = import_module(f"femtune.steps.{text.module}")
    blocks: list[Block] = getattr(module, text.function or text.id)(source)
    folded = text.optional and len(blocks) == 1 and isinstance(blocks[0], Paragraph)
    empty = folded or (text.optional and not blocks)
    intro = (Paragraph(text.intro, tone="muted"),) if text.intro and not empty else ()
    return Section(text.id, text.title, (*intro, *blocks), folded)


def _facts(results: Results) -> tuple[tuple[str, str], ...]:
    study, origin = results.study, results.provenance
    return (
        ((FromDeck if study.has_deck else ModelSource).title, study.deck_file),
        ("Configurations", ", ".join(study.configurations)),
        ("Units", study.units or "those of the deck (none are declared)"),
        ("Run", f"{origin.started_at}, femtune {origin.femtune_version}"),
    )


# ----------------------------------------------------------------------------------------------------
# Order, titles and opening words of the sections, from the files in text/.


@dataclass(frozen=True)
class SectionText:
    """One entry of the file; `function` (`id` by default) of `module` in `femtune.steps` makes the blocks.

    An `optional` section is folded where its step did not run, and left out where it has no blocks.
    """

    id: str
    module: str
    title: str
    intro: str = ""
    function: str = ""
    optional: bool = False


def section_texts(page: str = "report") -> tuple[SectionText, ...]:
    """All entries of a page, "report", "modes", "plan" or "responses", in their order."""
    text = files("femtune.steps.report").joinpath(f"text/{page}.toml").read_text(encoding="utf-8")
    return tuple(SectionText(**entry) for entry in tomllib.loads(text)["section"])
