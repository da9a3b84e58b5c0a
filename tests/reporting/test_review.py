"""The first section: verdict, changes and open questions; sections of steps that did not run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from femtune.document.document import Document, Heading, Paragraph, Table, flat
from femtune.reporting.html import html_text
from femtune.steps.report.build import build_report
from femtune.steps.report_source import ReportSource
from femtune.steps.results import Results
from femtune.steps.run.page.review import review

from .page_scripts import without_own_scripts


def _source(data: dict[str, Any], arrays: dict[str, Any]) -> ReportSource:
    return ReportSource(Results.model_validate(data), arrays)


def _criterion(measured: float | None, verdict: str, sense: str = "at most") -> dict[str, Any]:
    limit = 5.0 if sense == "at most" else 0.9
    return {"name": "error, X", "limit": limit, "sense": sense, "measured": measured, "unit": "", "verdict": verdict}


def _verdicts(data: dict[str, Any], arrays: dict[str, Any], by_configuration: Sequence[list[dict[str, Any]]]) -> Table:
    data["validation"] = None
    last = [c for c in data["correlations"] if c["stage"] == "after as written"]
    for c in data["correlations"]:
        c["criteria"] = []
    for c, criteria in zip(last, by_configuration):
        c["criteria"] = criteria
    return next(b for b in review(_source(data, arrays)) if isinstance(b, Table) and b.columns[-1].title == "Verdict")


def _texts(table: Table) -> list[list[str]]:
    return [[cell.text for cell in cells] for cells in table.rows]


def test_the_worst_configuration_decides(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    names = [c["configuration"] for c in data["correlations"] if c["stage"] == "after as written"]
    table = _verdicts(data, arrays, [[_criterion(1.0, "pass")], [_criterion(3.0, "pass")]])
    assert _texts(table) == [["error, X", "all paired modes", "≤ 5", "3", names[1], "pass"]]


def test_a_failure_outweighs_larger_values_that_passed(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    names = [c["configuration"] for c in data["correlations"] if c["stage"] == "after as written"]
    table = _verdicts(data, arrays, [[_criterion(0.5, "fail", "at least")], [_criterion(0.95, "pass", "at least")]])
    assert _texts(table) == [["error, X", "all paired modes", "≥ 0.9", "0.5", names[0], "fail"]]


def test_what_was_not_tested_is_no_pass(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    (cells,) = _texts(_verdicts(data, arrays, [[_criterion(None, "not tested")], [_criterion(None, "not tested")]]))
    assert cells[-1] == "not tested"
    (cells,) = _texts(_verdicts(data, arrays, [[_criterion(2.0, "pass")], [_criterion(None, "not tested")]]))
    assert (cells[-1], cells[-2].split("; ")[1]) == ("pass", "not tested in 1 of 2")


@pytest.mark.parametrize("modes", [True, False])
def test_the_summary_names_changes_and_what_stays_open(
    modes: bool, data: dict[str, Any], arrays: dict[str, Any]
) -> None:
    """Also where FRFs or masses alone are compared."""
    data["correlations"] = data["correlations"] if modes else []
    headings = [b.text for b in flat(review(_source(data, arrays))) if isinstance(b, Heading)]
    assert [h for h in headings if h in ("Acceptance criteria", "What changed", "What stays open")] == [
        "Acceptance criteria", "What changed", "What stays open",
    ]  # fmt: skip


def test_without_a_criterion_the_verdict_is_not_tested(data: dict[str, Any]) -> None:
    results = {"provenance": data["provenance"], "study": data["study"]}
    words = [b.text for b in review(_source(results, {})) if isinstance(b, Paragraph)]
    assert "Not tested: no criterion was evaluated." in words


@pytest.mark.slow
def test_steps_that_did_not_run_share_a_line(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    data["specimens"] = None
    document: Document = build_report(Results.model_validate(data), arrays)
    folded = [s for s in document.sections if s.folded]
    assert "specimens" in {s.id for s in folded}
    assert "summary" not in {s.id for s in folded}
    text = without_own_scripts(html_text(document))
    (line,) = (part for part in text.split("<summary>") if part.startswith("Not part of this study"))
    for section in folded:
        assert section.title in line
        assert f'href="#{section.id}"' not in text
