"""The short form on the terminal, and facts that the page says once."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from femtune.document.document import Document, Figure, Paragraph, Table
from femtune.reporting.terminal import print_terminal
from femtune.steps.report.build import build_report
from femtune.steps.results import Results
from femtune.steps.select.page import joined_rows
from femtune.steps.update.page.parameters import interval_remarks
from femtune.steps.update.record.update import ParameterResult
from femtune.steps.validate.page import outcome_sentence
from femtune.steps.validate.record.validation import ValidationResults


def _printed(document: Document) -> str:
    stream = io.StringIO()
    print_terminal(document, Console(file=stream, width=100))
    return stream.getvalue()


def _cells(document: Document, section: str) -> list[str]:
    found = next(s for s in document.sections if s.id == section)
    return [cell.text for b in found.blocks for row in getattr(b, "rows", ()) for cell in row]


def test_it_fits_two_screens_and_says_each_reason_once(document: Document) -> None:
    text = _printed(document)
    assert len(text.splitlines()) <= 75
    assert text.count("braces vibrate on their own") == 1
    assert "Left out, BC, NC, SC: 4a, 4b:" in text
    assert "NASA-STD-5002" not in text


def test_the_ratio_of_standard_deviations_is_that_of_the_two_in_the_report(
    document: Document, data: dict[str, Any]
) -> None:
    table = next(
        b
        for s in document.short
        for b in s.blocks
        if isinstance(b, Table) and "σ / prior σ" in [c.title for c in b.columns]
    )
    at = [c.title for c in table.columns].index("σ / prior σ")
    prior = {p["name"]: p["prior_sd"] for p in data["parameters"]}
    spread = {p["name"]: p["sd"] for p in data["update"]["parameters"]}
    shown = {r[0].text: r[at].text for r in table.rows}
    assert any(text != "–" for text in shown.values())
    for name, text in shown.items():
        if spread[name] is None or prior[name] is None:
            assert text == "–"
        else:
            assert float(text) == pytest.approx(spread[name] / prior[name], abs=0.006)


def _conditions(multipliers: dict[str, float]) -> dict[str, Any]:
    signs = [{"parameter": name, "value": v} for name, v in multipliers.items()]
    return {"projected_gradient": 2e-6, "predicted_decrease": 1e-12, "multipliers": signs}


@pytest.mark.slow
def test_it_says_which_point_the_result_is(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    update = data["update"]
    update |= {"chi_square": 12.5, "certificate": _conditions({"a": 0.3, "b": 0.1}), "smallest_change": None}

    def said() -> str:
        return " ".join(_printed(build_report(Results.model_validate(data), arrays)).split())

    point = "a minimum within the bounds, χ² = 12.5 (steepest slope within the bounds 2e−6, 2 parameters at a bound)"
    assert point in said()
    update["smallest_change"] = {
        "chi_square": 12.3, "allowed": 0.25, "increase": 0.2, "weight": 0.1, "size": 3.0, "optimum_size": 4.0,
        "optimum": [], "optimum_at_bound": [],
    }  # fmt: skip
    assert "the smallest change whose χ² is at most 0.25 above a minimum within the bounds, 12.3; it is 0.2" in said()
    update["certificate"] = None
    assert "within the bounds, 12.3" not in said()


def _parameter(name: str, at_bound: str = "", kind: str = "truncated") -> ParameterResult:
    found = {"name": name, "value": 1.0, "sd": 0.2, "sd_reason": "", "change_percent": 0.0, "written": ()}
    ends = {"interval_95": (0.9, 1.5), "interval_kind": kind, "at_bound": at_bound}
    return ParameterResult.model_validate({**found, **ends})


def test_how_intervals_contain_their_values_is_told_where_bounds_cut_them() -> None:
    (one,) = interval_remarks([_parameter("a", "lower"), _parameter("b", kind="bounds")])
    assert isinstance(one, Paragraph)
    assert "unless the value lies in a tail, as it does on a bound: there the tails differ" in one.text
    assert "hardly narrow b: its interval is nearly as wide as the bounds allow" in one.text


def test_criteria_that_were_not_tested_are_counted_beside_those_that_passed() -> None:
    one = {
        "configuration": "c",
        "data": "d",
        "criterion": "e",
        "sense": "at most",
        "required": 5.0,
        "unit": "%",
        "sentence": "",
    }
    passed = {**one, "measured": 1.0, "verdict": "pass", "remark": "", "noise": ""}
    not_tested = {**one, "measured": None, "verdict": "not tested", "remark": "one DOF", "noise": ""}

    def sentence(*verdicts: dict[str, Any]) -> str:
        empty = {"predictions": (), "not_tested": (), "profile": "all standards", "held_out_sensors": (), "shapes": ()}
        return outcome_sentence(ValidationResults.model_validate({**empty, "verdicts": verdicts}))

    assert sentence(passed, not_tested, not_tested).endswith(
        "1 of 1 criterion passed (all standards), 2 were not tested"
    )
    assert sentence(passed).endswith("1 of 1 criterion passed (all standards)")
    assert sentence(not_tested) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", ["I_beam_1 rises while", "Damping was not compared.", "at bound, σ not given", "criteria ("]
)
def test_it_says_what_matters(document: Document, words: str) -> None:
    assert words in " ".join(_printed(document).split())


def test_criteria_that_were_not_tested_are_grouped_by_reason(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    quantity, reasons = "cross-orthogonality, diagonal", ("no mass", "no mass", "one pair")
    names = [f"{quantity}, NASA-STD-5002", f"{quantity}, MIL-STD-1540C", "self-orthogonality, NASA-STD-5002"]
    first = data["correlations"][0]["criteria"][0]
    changed = {"verdict": "not tested", "measured": None}
    criteria = [{**first, **changed, "name": n, "remark": r} for n, r in zip(names, reasons, strict=True)]
    for c in data["correlations"]:
        c["criteria"] = criteria
    text = " ".join(_printed(build_report(Results.model_validate(data), arrays)).split())
    assert "• criteria (no mass): cross-orthogonality, diagonal (MIL-STD-1540C, NASA-STD-5002) •" in text
    assert "• criteria (one pair): self-orthogonality (NASA-STD-5002) •" in text


def test_it_draws_no_picture(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    document = build_report(Results.model_validate(data), arrays)
    _printed(document)
    figures = [b for s in document.sections for b in s.blocks if isinstance(b, Figure)]
    assert figures
    assert not any("svg" in vars(f) for f in figures)


def test_many_modes_are_cut_and_counted(slim: dict[str, Any], arrays: dict[str, Any]) -> None:
    for c in slim["correlations"]:
        one = c["unpaired_test"][0]
        c["unpaired_test"] = [{**one, "test_label": f"t{i}", "test_freq_hz": 30.0 + i} for i in range(20)]
    assert "and 15 more test modes in the HTML report" in _printed(build_report(Results.model_validate(slim), arrays))


@pytest.mark.parametrize(("mac", "said"), [(0.8, True), (0.4, False)])
def test_a_model_mode_like_one_that_was_left_out_says_so(
    slim: dict[str, Any], arrays: dict[str, Any], mac: float, said: bool
) -> None:
    for c in slim["correlations"]:
        c["left_out"] = [{"test_label": "3", "test_freq_hz": 5.5, "reason": "noise"}]
        c["pairs"] = [p for p in c["pairs"] if p["test_label"] != "3"]
        arrays[c["mac_key"]][2, 3] = mac
    cells = _cells(build_report(Results.model_validate(slim), arrays), "modes")
    assert (f"resembles test mode 3 (MAC {mac:.3f}), which was left out" in cells) is said


def test_the_page_says_a_reason_once(document: Document) -> None:
    cells = [text for s in document.sections for text in _cells(document, s.id)]
    assert cells.count("braces vibrate on their own near 10 Hz") == 1


def test_rows_of_one_residual_are_joined() -> None:
    labels, values = joined_rows(("f", "s", "s"), np.array([[-2.0, 1.0], [3.0, 0.0], [-4.0, 0.0]]))
    assert labels == ["f", "s"]
    assert values.tolist() == [[-2.0, 1.0], [5.0, 0.0]]
