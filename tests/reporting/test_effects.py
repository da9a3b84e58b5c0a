"""Pictures of designed experiments: what they show is what they were given."""

from __future__ import annotations

import re

import numpy as np
import pytest

from femtune.document.figures.effects import beside_svg, main_effects_svg, search_svg
from femtune.document.figures.histograms import histograms_svg


@pytest.mark.slow
def test_main_effects_have_a_panel_for_every_parameter_and_a_line_for_every_response() -> None:
    svg = main_effects_svg(
        ["stiffness <1>", "density"], ["mode 1", "mode 2"], [[0.8, 1.0, 1.2], [0.9, 1.1]],
        [[[-1.0, -2.0], [0.0, 0.0], [1.0, 2.0]], [[0.5, 1.0], [-0.5, -1.0]]],
    )  # fmt: skip
    for text in ("stiffness &lt;1&gt;", "density", "mode 1", "mode 2", "0.8", "1.2", "change in %"):
        assert text in svg
    assert svg == svg.encode().decode()
    # markers of 3 levels and 2 levels, of 2 responses each, and those of the legend
    assert len(re.findall(r"<use ", svg)) >= 10


@pytest.mark.slow
def test_a_search_is_drawn_by_evaluations() -> None:
    svg = search_svg([("genetic", [10, 20, 30], [1.0, 0.1, 0.05]), ("cma-es", [10, 20], [0.5, 0.05])], [0.05])
    for text in ("genetic", "cma-es", "evaluations", "objective"):
        assert text in svg


def test_two_values_of_each_parameter_and_response() -> None:
    values = [[[(0.5, 0.4, 0.6), (0.7, 0.6, 0.8)], [(0.1, 0.0, 0.2), (0.3, 0.2, 0.4)]]]
    svg = beside_svg(["stiffness <1>", "density"], ["mode 1"], values, ("first", "total"), "part of the variance")
    for text in ("stiffness &lt;1&gt;", "density", "mode 1", "first", "total", "part of the variance"):
        assert text in svg


@pytest.mark.slow
def test_powers_of_ten_are_plain_numbers() -> None:
    svg = search_svg([("genetic", [10, 20, 30], [3000.0, 20.0, 4.0])], [4.0])
    shown = re.findall(r">([^<>]*)</text>", svg)
    assert not [text for text in shown if "$" in text]
    assert {"10", "100", "1000"} <= set(shown)


@pytest.mark.slow
def test_less_than_a_decade_has_numbers_too() -> None:
    svg = search_svg([("genetic", [10, 20, 30], [3.2, 2.2, 1.4])], [1.4])
    assert "2" in re.findall(r">([^<>]*)</text>", svg)


def test_numbers_below_a_histogram_differ_where_the_samples_hardly_do() -> None:
    samples = 0.97999 + 6.5e-5 * np.linspace(-3.0, 3.0, 200)[:, None]
    shown = re.findall(r">([^<>]*)</text>", histograms_svg(["t"], samples, [0.97999], [(0.9798, 0.9801)]))
    numbers = [text for text in shown if text.startswith("0.9")]
    assert len(numbers) == len(set(numbers)) >= 2
