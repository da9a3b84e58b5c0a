"""Intervals, physical values and identified deviations in a whole study."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.deviations import deviations_text
from femtune.reporting.html import html_text
from femtune.reporting.terminal import print_terminal
from femtune.steps.report.build import build_report
from femtune.steps.run.alerts import alerts_of
from femtune.study.study import load_study
from femtune.testdata import ModalTest

from .cantilever import Bench

SHAPES = '[[residual]]\nkind = "shape"\n'


def printed(run: Any) -> str:
    stream = io.StringIO()
    print_terminal(build_report(run.results, run.arrays), Console(file=stream, width=200))
    return " ".join(stream.getvalue().split())


@pytest.mark.slow
def test_weak_data_give_positive_intervals_within_the_bounds(beam: Bench) -> None:
    """With frequencies of 30 % the linear interval of a second moment of area would reach below zero."""
    tail = beam.parameters.replace("lower = 0.5", "lower = 0.05").replace("upper = 2.0", "upper = 4.0")
    tail += '[[derived]]\nname = "depth"\nexpression = "root**(1/3)"\n[residuals]\nfrequency_sd = 0.8\n'
    run = ft.update(beam.study(tail))
    update = run.results.update
    assert update is not None
    for p in update.parameters:
        assert p.sd is not None
        assert p.value - 1.96 * p.sd < 0.0
        assert p.interval_95 is not None
        assert 0.05 <= p.interval_95[0] < p.median < p.interval_95[1] <= 4.0
        assert p.interval_kind in ("truncated", "bounds")
        assert p.interval_95[0] < p.mean < p.interval_95[1]
    (depth,) = update.derived
    low, high = update.parameters[0].interval_95
    np.testing.assert_allclose(depth.interval_95, np.cbrt([low, high]), rtol=1e-6)
    assert update.interval_samples >= 1000.0
    few = update.model_copy(update={"interval_samples": 12.3})
    told = alerts_of(load_study(beam.folder / "study.toml"), run.results.model_copy(update={"update": few}))
    (few_samples,) = (a for a in told if a.code == "update.few-samples")
    check_shown("update.few-samples", f"[{few_samples.code}] {few_samples.sentence}")
    text = printed(run)
    assert "the distribution of the linearised problem, truncated to the bounds. They are equal-tailed, unless" in text


@pytest.mark.slow
def test_factors_are_shown_with_the_values_of_their_fields(beam: Bench) -> None:
    """Report, terminal, results and rows have initial value, unit, updated value and interval of every field."""
    run = ft.update(beam.study(beam.parameters + "[residuals]\nfrequency_sd = 0.01\n"))
    update = run.results.update
    assert update is not None
    root = update.parameters[0]
    (field,) = root.physical
    assert (field.field, field.unit, field.nominal) == ("PBAR 1 I1", "m⁴", pytest.approx(2e-7))
    assert field.value == pytest.approx(2e-7 * root.value)
    assert root.interval_95 is not None
    assert field.interval_95 == pytest.approx([2e-7 * end for end in root.interval_95])
    assert run.physical[0]["field"] == "PBAR 1 I1"
    assert run.parameters[0]["interval_kind"] == "normal"
    assert run.parameters[0]["interval_95_lower"] == root.interval_95[0]
    page = html_text(build_report(run.results, run.arrays))
    for text in (printed(run), page):
        assert "Physical values of the factors" in text
        assert "PBAR 1 I1" in text
        assert "m⁴" in text


@pytest.mark.slow
def test_values_that_are_no_factors_are_not_shown_twice(beam: Bench) -> None:
    tail = '[[parameter]]\nname = "I"\nfields = ["PBAR 1 I1"]\nabsolute = true\nlower = 1e-7\nupper = 4e-7\n'
    run = ft.update(beam.study(tail))
    assert run.results.update is not None
    assert run.results.update.parameters[0].physical == ()


def with_deviations(beam: Bench) -> ModalTest:
    """The test of the true beam, with the deviations of an identification in a file beside it."""
    test = beam.measure(beam.truth())
    modes = test.modes
    assert modes is not None
    spread = 0.02 * np.abs(modes.shapes).max(axis=0) * np.ones(modes.shapes.shape)
    known = replace(modes, freq_sd_hz=0.001 * modes.freq_hz, shapes_sd=spread)
    beam.write("deviations.json", str(deviations_text(known)))
    return replace(test, modes=known)


@pytest.mark.slow
def test_deviations_of_a_file_weigh_frequencies_and_shapes(beam: Bench) -> None:
    """As the same test given as an object with its deviations does; the report says where they come from."""
    with_deviations(beam)
    head = '[test]\nfile = "beam.uff"\ndeviations = "deviations.json"\n'
    tail = head + beam.parameters + '[[residual]]\nkind = "frequency"\nsd = "test"\n' + SHAPES
    run = ft.update(beam.study(tail, test=None))
    update = run.results.update
    assert update is not None
    counts = {c.kind: c for c in update.residual_counts}
    assert counts["frequency"].sd_of_test
    assert counts["shape"].sd_of_test
    assert update.parameters[0].value == pytest.approx(1.3, rel=1e-3)
    said = "The standard deviations of frequency and shape residuals are those of the test."
    assert said in html_text(build_report(run.results, run.arrays))
    assert any(f.path == "deviations.json" for f in run.results.provenance.input_files)
    short = head + beam.parameters + '[residuals]\nfrequency_sd = "test"\nshape_sd = "test"\n'
    again = ft.update(beam.study(short, test=None)).results.update
    assert again is not None
    assert again.parameters[0].sd == pytest.approx(update.parameters[0].sd, rel=1e-6)
    stated = head + beam.parameters + "[residuals]\nfrequency_sd = 0.001\n"
    other = ft.update(beam.study(stated, test=None)).results.update
    assert other is not None
    assert not any(c.sd_of_test for c in other.residual_counts)
    # the shapes add information
    assert update.parameters[0].sd < other.parameters[0].sd


def test_shapes_need_deviations_from_somewhere(beam: Bench) -> None:
    with pytest.raises(FemtuneError) as error:
        ft.update(beam.study(beam.parameters + SHAPES))
    assert error.value.code == "residual.no-scatter"
    assert "shapes" in error.value.what


_AT_TWO = '[[residual]]\nkind = "shape"\nsd = "test"\nsensors = ["2Z+", "3Z+"]\n'


@pytest.mark.slow
@pytest.mark.parametrize(
    ("residuals", "modes"),
    [
        ('[residuals]\nfrequency_sd = "test"\n', ["modes 3, 4 are"]),
        # all sensors are compared, and mode 1 has the deviations of two
        ('[residuals]\nfrequency_sd = "test"\nshape_sd = "test"\n', ["modes 1, 2, 3, 4 are"]),
        (_AT_TWO + '[[residual]]\nkind = "frequency"\nsd = "test"\n', ["modes 2, 3, 4 are", "modes 3, 4 are"]),
        (_AT_TWO + 'modes = ["1", "3"]\n', ["modes 3 are"]),
    ],
)
def test_check_names_modes_whose_deviations_the_test_does_not_give(
    beam: Bench, residuals: str, modes: list[str]
) -> None:
    """The table gives mode 1 the deviations of its frequency and of two entries, mode 2 that of its frequency only."""
    (beam.folder / "sd.csv").write_text("mode,dof,sigma\n1,frequency,0.01\n2,frequency,0.01\n1,2Z+,0.01\n1,3Z+,0.01\n")
    text = '[test]\nfile = "beam.uff"\ndeviations = "sd.csv"\n'
    found = ft.check(beam.study(text + residuals + beam.parameters, test=None)).record
    told = [p.message for p in found.problems if p.code == "residual.no-scatter"]
    assert len(told) == len(modes)
    assert all(some in message for some, message in zip(modes, told))
    assert found.errors == 0


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ('[residuals]\nshape_sd = "test"\nshape_form = "mac"\n', "residual.weights"),
        ('[residuals]\nshape_sd = "tests"\n', "study.type"),
        ('[[residual]]\nkind = "shape"\nsd = "tests"\n', "study.type"),
    ],
)
def test_other_words_are_refused(beam: Bench, text: str, code: str) -> None:
    with pytest.raises(FemtuneError) as error:
        ft.update(beam.study(beam.parameters + text))
    assert error.value.code == code
