"""Responses in the report and on their page."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from femtune.document.document import Figure, Table
from femtune.document.figures.frfs import FrfCurve, FrfPanel, frfs_svg, thinned
from femtune.steps.report.view import view_of
from femtune.steps.report_source import ReportSource
from femtune.steps.respond.page import frequency_responses, load_blocks, ordered_pairs, pole_blocks
from femtune.steps.respond.record import ComplexPole, Displacement, FrfPair, FrfResults, ResponseResults, StaticResults

from .packed import unpacked


def _curve(look: str, count: int = 200) -> FrfCurve:
    lines = np.linspace(1.0, 100.0, count)
    return FrfCurve(look, lines, -(lines**2) / (900.0 * (1 + 0.02j) - lines**2))


def _texts(svg: str) -> list[str]:
    return ["".join(e.itertext()) for e in ET.fromstring(svg).iter() if e.tag.endswith("text")]


@pytest.mark.slow
def test_a_picture_names_its_curves_and_axes() -> None:
    panel = FrfPanel("5Z+ by 5Z+ & <b>", "accelerance, m/s²/N", tuple(map(_curve, ("before", "test", "after"))))
    texts = _texts(frfs_svg([panel, panel, panel]))
    assert {"model before", "model after", "test", "phase, °", "accelerance, m/s²/N", "5Z+ by 5Z+ & <b>"} <= set(texts)
    assert "10" in texts


@pytest.mark.slow
def test_functions_that_vanish_are_drawn_too() -> None:
    lines = np.array([1.0, 2.0])
    zero = FrfPanel("a", "b", (FrfCurve("model", lines, np.zeros(2, complex)),))
    gap = FrfPanel("a", "b", (FrfCurve("model", lines, np.array([np.nan, 1j])),))
    single = FrfPanel("a", "b", (FrfCurve("model", lines[:1], np.array([1j])),))
    assert frfs_svg([zero, gap, single]).startswith("<?xml")


def test_thinning_keeps_peaks() -> None:
    lines = np.arange(100_000.0)
    values = np.ones(100_000, complex)
    values[77_777], values[3] = 50.0, 0.001
    freq_hz, kept = thinned(lines, values)
    assert len(freq_hz) <= 1502
    assert {77_777.0, 3.0, 0.0, 99_999.0} <= set(freq_hz)
    assert np.abs(kept).max() == 50.0
    assert np.array_equal(thinned(lines[:9], values[:9])[0], lines[:9])


def _frfs(stage: str, outputs: int = 9) -> FrfResults:
    names = tuple(f"{k + 1}Z+" for k in range(outputs))
    pairs = tuple(
        FrfPair(output=n, input="3Z+", driving_point=k == 2, peak_hz=30.0, peak=10.0 + k, test_peak_hz=31.0,
                test_peak=9.0, frac=0.5)
        for k, n in enumerate(names)
    )  # fmt: skip
    return FrfResults(
        kind="accelerance", unit="m/s²/N", method="real modes", modes=4, residual_vectors=True, damping="dashpots",
        outputs=names, inputs=("3Z+",), freq_key=f"{stage}/hz", values_key=f"{stage}/values", pairs=pairs,
        test_freq_key="test/hz", test_values_key="test/values",
    )  # fmt: skip


@pytest.fixture
def source() -> ReportSource:
    """Nine functions before and after, all measured."""
    stages = ("before", "after as written")
    found = tuple(ResponseResults(configuration="BC", stage=s, frfs=_frfs(s)) for s in stages)  # type: ignore[arg-type]
    curve = _curve("model")
    arrays = {f"{s}/hz": curve.freq_hz for s in (*stages, "test")}
    values = curve.values * np.arange(1, 10)[:, None, None]
    arrays |= {f"{s}/values": values for s in (*stages, "test")}

    class _Results:
        responses, mode_shapes, update, mapped_damping, live, correlations = found, (), None, (), None, ()

    return ReportSource(_Results(), arrays)  # type: ignore[arg-type]


@pytest.mark.slow
def test_driving_points_come_first_then_the_largest(source: ReportSource) -> None:
    frfs = source.results.responses[0].frfs
    assert frfs is not None
    assert ordered_pairs(frfs)[:3] == [2, 8, 7]
    blocks = frequency_responses(source)
    (figure,) = [b for b in blocks if isinstance(b, Figure)]
    (table,) = [b for b in blocks if isinstance(b, Table)]
    assert "3Z+ by 3Z+ (driving point)" in figure.alt
    assert figure.alt.count(" by ") == 6
    assert len(table.rows) == 9
    assert "model before" in _texts(figure.svg)


def test_tables_of_poles_and_loads() -> None:
    shared = {"phase_collinearity": 0.8, "real_mode": 2, "real_freq_hz": 10.0}
    poles = (
        ComplexPole(kind="rigid", freq_hz=0.0, damping_ratio=None, **shared),
        ComplexPole(kind="oscillating", freq_hz=11.0, damping_ratio=0.05, **shared),
        ComplexPole(kind="real", freq_hz=4.0, damping_ratio=1.0, **shared),
    )
    load = StaticResults(
        load="tip", forces=("5Z+ 100",), inertia_relief=True,
        displacements=(Displacement(output="5Z+", value=-0.0012345),),
    )  # fmt: skip
    found = ResponseResults(configuration="BC", stage="before", frfs=_frfs("before"), poles=poles, loads=(load,))
    (table,) = pole_blocks([found])
    assert isinstance(table, Table)
    assert [cells[1].text for cells in table.rows] == ["rigid body", "11.000", "4.000 (no oscillation)"]
    assert [c.text for c in table.rows[1]] == ["2", "11.000", "5.00", "0.800", "2", "10.000", "+10.00"]
    (moved,) = load_blocks([found])
    assert isinstance(moved, Table)
    assert [c.text for c in moved.rows[0]] == ["5Z+", "−0.0012345"]
    assert "inertia relief is applied" in moved.note


def test_displacements_show_the_length_of_the_study() -> None:
    def heads(output: str, unit: str) -> list[str]:
        moved = (Displacement(output=output, value=-0.5),)
        load = StaticResults(load="tip", forces=("5Z- 100",), inertia_relief=False, displacements=moved)
        (table,) = load_blocks([ResponseResults(configuration="BC", stage="before", loads=(load,))], unit)
        assert isinstance(table, Table)
        return [column.title for column in table.columns]

    assert heads("5Z+", "mm") == ["Output", "Displacement, mm"]
    assert heads("5RZ+", "mm") == ["Output", "Displacement, mm or rad"]
    assert heads("5Z+", "") == ["Output", "Displacement"]


@pytest.mark.slow
def test_a_test_and_a_model_that_coincide_stay_apart_in_colour() -> None:
    svg = frfs_svg([FrfPanel("1Z+", "a", (_curve("test"), _curve("after")))])
    assert "#f2b27e" in svg
    assert "#1f5a92" in svg
    assert "opacity" not in svg
    assert svg.index("#f2b27e") < svg.index("#1f5a92")


def test_functions_are_those_of_the_results(source: ReportSource) -> None:
    (shown,) = view_of(source).functions
    last = [r for r in source.results.responses if r.configuration == shown.configuration][-1].frfs
    assert last is not None
    values, curve = np.asarray(source.array(last.values_key)), shown.curves[-1]
    found = unpacked(curve.real) + 1j * unpacked(curve.imaginary)
    for title, line in zip(shown.titles, found):
        output, _, rest = title.partition(" by ")
        at = last.outputs.index(output), last.inputs.index(rest.removesuffix(" (driving point)"))
        np.testing.assert_allclose(line, values[at], rtol=1e-6)
