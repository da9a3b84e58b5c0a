"""Intervals from a study without a test: the published ones of three masses, separate and close, in both directions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError

HEAD = "SOL 103\nCEND\nMETHOD=1\nBEGIN BULK\nEIGRL,1,,,3\n"
GRIDS = "".join(f"GRID,{i},,{i}.,0.,0.,,23456\n" for i in (1, 2, 3))
SEPARATE = ((0.86482, 1.13176), (3.53112, 4.46370), (7.80405, 8.20454))
CLOSE = ((0.92454, 1.07462), (3.65046, 4.20000), (3.80000, 4.35038))
"""Eigenvalues, rad²/s², as published."""


def hz(eigenvalue: float) -> float:
    return float(np.sqrt(eigenvalue) / (2.0 * np.pi))


def study(folder: Path, close: bool, more: str = "", wide: float = 1.0) -> Path:
    """k1, k2, k5 of six springs within ±20 %; or k2, k4, k5 of four, with two equal frequencies."""
    masses = (1.0, 4.0, 1.0) if close else (1.0, 1.0, 1.0)
    text = HEAD + GRIDS + "".join(f"CONM2,{10 + i},{i},,{m}\n" for i, m in enumerate(masses, start=1))
    if close:
        springs = {2: (8.0, 2, None), 4: (2.0, 1, 2), 5: (2.0, 2, 3), 6: (1.0, 1, 3)}
        bounds = {2: (7.5 / 8.0, 8.5 / 8.0), 4: (0.9, 1.1), 5: (0.9, 1.1)}
    else:
        ends = ((1, None), (2, None), (3, None), (1, 2), (2, 3), (1, 3))
        springs = {i: (3.0 if i == 6 else 1.0, *pair) for i, pair in enumerate(ends, start=1)}
        bounds = {1: (0.8, 1.2), 2: (0.8, 1.2), 5: (0.8, 1.2)}
    for i, (k, one, other) in springs.items():
        text += f"CELAS2,{i},{k},{one},1" + (f",{other},1\n" if other else "\n")
    (folder / "m.bdf").write_text(text + "ENDDATA\n")
    parameters = "".join(
        f'[[parameter]]\nname = "k{i}"\nfields = ["CELAS2 {i} K"]\nlower = {1 - wide * (1 - low)}\n'
        f"upper = {1 + wide * (high - 1)}\n"
        for i, (low, high) in bounds.items()
    )
    head = '[study]\ntitle = "masses"\ndeck = "m.bdf"\nunits = "m-kg-s"\n[modes]\ncount = 3\n'
    (folder / "s.toml").write_text(head + parameters + more)
    return folder / "s.toml"


@pytest.mark.parametrize(("close", "published"), [(False, SEPARATE), (True, CLOSE)], ids=["separate", "close"])
def test_frequencies_of_a_box(tmp_path: Path, close: bool, published: tuple[tuple[float, float], ...]) -> None:
    found = ft.intervals(study(tmp_path, close), report=tmp_path / "page.html")
    assert found.record.proven
    assert not found.record.of_limits
    eigenvalues = [[(2.0 * np.pi * v) ** 2 for v in (f.lower_hz, f.upper_hz)] for f in found.frequencies]
    np.testing.assert_allclose(eigenvalues, published, atol=6e-6)
    assert not any(f.inside for f in found.frequencies)
    assert "Box of the parameters" in (tmp_path / "page.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(("close", "published"), [(False, SEPARATE), (True, CLOSE)], ids=["separate", "close"])
def test_the_box_of_given_limits(tmp_path: Path, close: bool, published: tuple[tuple[float, float], ...]) -> None:
    """Back to the published stiffnesses, from the five printed digits of the eigenvalues and wider bounds."""
    limits = ", ".join(f"[{hz(low)!r}, {hz(high)!r}]" for low, high in published)
    found = ft.intervals(study(tmp_path, close, f"[intervals]\nlimits_hz = [{limits}]\n", wide=3.0))
    record = found.record
    # k4 and k5 act alike on a symmetric structure: that they are equal follows from the first box
    assert (record.ok, record.proven, record.of_limits) == (not close, True, True)
    assert record.error_percent < 1e-3
    box = {p.parameter: (p.lower, p.upper) for p in found.parameters}
    true = {"k2": (0.9375, 1.0625), "k4": (0.9, 1.1), "k5": (0.9, 1.1)} if close else dict.fromkeys(
        ("k1", "k2", "k5"), (0.8, 1.2)
    )  # fmt: skip
    for name, ends in true.items():
        assert box[name] == pytest.approx(ends, abs=2e-4), name
    assert [f.limits_hz is not None for f in record.frequencies] == [True] * 3


def test_a_box_past_the_bounds_is_told(tmp_path: Path) -> None:
    limits = ", ".join(f"[{hz(low)!r}, {hz(high)!r}]" for low, high in SEPARATE)
    record = ft.intervals(study(tmp_path, False, f"[intervals]\nlimits_hz = [{limits}]\n", wide=0.5)).record
    assert not record.ok
    assert record.sentences[1].startswith("The box is wider than the bounds of k1, k2, k5")


def test_limits_that_leave_the_box_open_are_not_ok(tmp_path: Path) -> None:
    """One frequency for three stiffnesses."""
    found = ft.intervals(study(tmp_path, False, f"[intervals]\nlimits_hz = [[{hz(0.9)}, {hz(1.1)}]]\n", wide=2.0))
    assert not found.record.ok
    assert "do not determine all ends" in found.record.sentences[1]


def test_fewer_limits_than_ends_of_the_box_leave_it_open(tmp_path: Path) -> None:
    """Smooth combinations of ends have effects of second order, which do not determine them."""
    path = study(tmp_path, False, f"[intervals]\nlimits_hz = [[{hz(0.9)}, {hz(1.1)}]]\n", wide=2.0)
    text = path.read_text()
    # k1 and k2 only
    path.write_text(text[: text.rindex("[[parameter]]")] + text[text.index("[intervals]") :])
    record = ft.intervals(path).record
    assert len(record.parameters) == 2
    assert not record.ok
    assert "do not determine all ends" in record.sentences[1]


def test_limits_that_no_box_has_name_the_parameters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limits = [SEPARATE[0], (3.9, 3.95), SEPARATE[2]]
    text = ", ".join(f"[{hz(low):.6f}, {hz(high):.6f}]" for low, high in limits)
    study(tmp_path, False, f"[intervals]\nlimits_hz = [{text}]\n", wide=2.0)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FemtuneError) as caught:
        ft.intervals(Path("s.toml"))
    check_shown("quantify.interval, no box", caught.value)


def test_the_first_sentence_gives_the_frequencies(tmp_path: Path) -> None:
    first = ft.intervals(study(tmp_path, False)).record.sentences[0]
    assert first.endswith(f"{hz(SEPARATE[0][0]):.5g} to {hz(SEPARATE[0][1]):.5g} Hz, 0.29907 to 0.33625 Hz, 0.44461 to "
                          "0.45588 Hz.")  # fmt: skip


def test_a_parameter_without_effect_leaves_the_proof(tmp_path: Path) -> None:
    more = '[[parameter]]\nname = "unused"\nfields = ["CELAS2 20 K"]\nlower = 0.9\nupper = 1.1\n'
    path = study(tmp_path, False, more)
    deck = tmp_path / "m.bdf"
    deck.write_text(deck.read_text().replace("ENDDATA", "CELAS2,20,5.0,1,2\nENDDATA"))
    assert ft.intervals(path).record.proven


@pytest.mark.parametrize(
    ("name", "more"),
    [
        ("quantify.interval, limits", "[intervals]\nlimits_hz = [[0.2, 0.1]]\n"),
        ("quantify.interval, order", "[intervals]\nlimits_hz = [[0.3, 0.4], [0.1, 0.2]]\n"),
        ("quantify.interval, configuration", '[intervals]\nconfiguration = "bare"\n'),
        ("quantify.interval, count", "[intervals]\nlimits_hz = [[0.1, 0.2], [0.2, 0.3], [0.3, 0.4], [0.4, 0.5]]\n"),
    ],
)
def test_refusals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, more: str) -> None:
    study(tmp_path, False, more)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FemtuneError) as caught:
        ft.intervals(Path("s.toml"))
    check_shown(name, caught.value)
