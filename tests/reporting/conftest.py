"""Results that were made up for the purpose, their arrays and their report."""

from __future__ import annotations

from typing import Any

import pytest

from femtune.document.document import Document
from femtune.steps.report.build import build_report
from femtune.steps.results import Results

from .compared_data import all_arrays
from .whole_data import full_data


@pytest.fixture
def data() -> dict[str, Any]:
    """Plain data that a test may change."""
    return full_data()


@pytest.fixture
def slim(data: dict[str, Any]) -> dict[str, Any]:
    """The same with one configuration and few pictures."""
    keys = ("auto_mac_test_key", "auto_mac_model_key", "cross_orthogonality_key")
    data["study"]["configurations"] = ["BC"]
    data["correlations"] = [
        {**c, **dict.fromkeys(keys)}
        for c in data["correlations"]
        if c["configuration"] == "BC" and c["stage"] != "after"
    ]
    data["mode_shapes"] = [m for m in data["mode_shapes"] if m["configuration"] == "BC"]
    return data


@pytest.fixture
def arrays() -> dict[str, Any]:
    """All arrays by key."""
    return all_arrays()


@pytest.fixture(scope="session")
def results() -> Results:
    """The whole; frozen."""
    return Results.model_validate(full_data())


@pytest.fixture(scope="session")
def document(results: Results) -> Document:
    """Its report; pictures take time, so it is made once."""
    return build_report(results, all_arrays())
