"""Sections of the report on weights that a rule found and on many starts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from femtune.document.document import Block, Figure, Paragraph, Table
from femtune.steps.bootstrap.record import BootstrapResults
from femtune.steps.report_source import ReportSource
from femtune.steps.results import Results
from femtune.steps.run.page.short_form import short_form
from femtune.steps.update.page.parameters import parameters
from femtune.steps.update.page.starts import starts, weight_choice


@pytest.fixture
def searched(data: dict[str, Any]) -> Results:
    """The results of the other tests with a path of weights and four starts."""
    update, n = data["update"], len(data["update"]["history_parameters"])
    update["weight_choice"] = {
        "rule": "l-curve", "status": "CORNER", "found": True, "sentence": "the weight is that of the corner",
        "weight": 0.1, "path": [_point(w, n) for w in np.geomspace(1e-3, 10.0, 21)],
    }  # fmt: skip
    update["starts"] = {
        "seed": 5, "unique": False, "sentences": ["2 of 4 starts reached the same optimum.", "It is not unique."],
        "noise": 1.0, "starts": [_start(i, n) for i in range(1, 5)],
        "optima": [
            {"objective": 1.0, "parameters": [1.0] * n, "starts": [1, 2], "as_good": True},
            {"objective": 1.2, "parameters": [1.1] * n, "starts": [3], "as_good": True},
            {"objective": 90.0, "parameters": [0.7] * n, "starts": [4], "as_good": False},
        ],
    }  # fmt: skip
    return Results.model_validate(data)


def _point(weight: float, n: int) -> dict[str, Any]:
    return {"weight": weight, "residual_norm": weight, "constraint_norm": 1.0 / weight, "curvature": 0.0,
            "cross_validation": None, "parameters": [1.0 + 0.1 / (1.0 + weight)] * n}  # fmt: skip


def _start(number: int, n: int) -> dict[str, Any]:
    return {"number": number, "start": [0.9] * n, "end": [1.0] * n, "objective": 1.0, "outcome": "BEST",
            "sentence": "reached the best optimum that was found", "tries": 1, "iterations": 7}  # fmt: skip


def _svg(blocks: list[Block]) -> str:
    (figure,) = [b for b in blocks if isinstance(b, Figure)]
    return str(figure.draw())


@pytest.mark.slow
def test_the_weight_is_told_and_drawn(searched: Results) -> None:
    assert searched.update is not None
    blocks = weight_choice(searched.update, searched.parameters)
    assert isinstance(blocks[0], Paragraph)
    assert "the weight is that of the corner. It is 0.1" in blocks[0].text
    svg = _svg(blocks)
    for words in ("norm of the side constraint", "norm of the residuals", "change in %"):
        assert words in svg


def test_starts_are_told_drawn_and_listed(searched: Results) -> None:
    assert searched.update is not None
    blocks = starts(searched.update, searched.parameters)
    assert isinstance(blocks[0], Paragraph)
    assert blocks[0].text.startswith("4 starts, seed 5: 2 of 4 starts reached the same optimum. It is not unique.")
    assert "upper" in _svg(blocks)
    (table,) = [b for b in blocks if isinstance(b, Table)]
    assert len(table.rows) == 3


def test_the_terminal_has_the_optima_and_the_bootstrap(searched: Results) -> None:
    assert searched.update is not None
    one = searched.update.parameters[0]
    spread = {"mean": one.value, "sd": 0.1, "cov_percent": 10.0, "bias": 0.0, "linear_sd": 0.1, "fisher_sd": 0.1,
              "fisher_cov_percent": 10.0, "interval_95": (0.8, 1.2), "at_bound_percent": 0.0}  # fmt: skip
    row = {"parameter": one.name, "value": one.value} | spread
    drawn = BootstrapResults.model_validate({
        "method": "lines", "runs": 50, "converged": 50, "seed": 0, "drawn_from": 400, "jacobian": "shared",
        "own_jacobian": 0, "largest_difference": None, "checked": 0, "solutions": 60, "recalled": 0, "seconds": 1.0,
        "executor": "one process", "free": (one.name,), "samples_key": "a", "correlation_key": "b",
        "sentences": ("50 of 50 runs converged.",), "parameters": [row],
    })  # fmt: skip
    sections = {s.id: s for s in short_form(ReportSource(searched.model_copy(update={"bootstrap": drawn}), {}))}
    (optima,) = [b for b in sections["starts"].blocks if isinstance(b, Table)]
    (spreads,) = [b for b in sections["bootstrap"].blocks if isinstance(b, Table)]
    assert len(optima.rows) == 3
    assert [cells[0].text for cells in spreads.rows] == [one.name]
    update = searched.update.model_copy(update={"starts": None})
    without = short_form(ReportSource(searched.model_copy(update={"update": update}), {}))
    assert not {"starts", "bootstrap"} & {s.id for s in without}


def test_nothing_to_tell(results: Results) -> None:
    assert results.update is not None
    assert weight_choice(results.update, results.parameters) == []
    assert starts(results.update, results.parameters) == []


def test_an_interval_that_says_less_than_the_bounds_is_said_so(data: dict[str, Any]) -> None:
    first, second = data["update"]["parameters"][:2]
    facts = {p["name"]: p for p in data["parameters"]}
    bounds = facts[first["name"]]
    first["interval_95"] = [bounds["lower"] - bounds["nominal"], bounds["upper"] + bounds["nominal"]]
    second["interval_95"] = [0.9 * second["value"], 1.1 * second["value"]]
    source = ReportSource(Results.model_validate(data), {})
    table = next(b for b in parameters(source) if isinstance(b, Table) and b.title == "Values")
    column = [c.title for c in table.columns].index("95 %")
    cells = {cells[0].text: cells[column].text for cells in table.rows}
    assert cells[first["name"]] == "wider than the bounds"
    assert " … " in cells[second["name"]]
