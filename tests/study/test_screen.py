"""Screening through the step: effects against decks that are solved one by one, modes that change order, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError, Notice
from femtune.experiments import orthogonal_array
from femtune.study.model_runs import FollowedModes

from .cantilever import CANTILEVER, EI, Bench

MASS = '\n[[parameter]]\nname = "mass"\nfields = ["CONM2 9 M"]\nlower = 0.8\nupper = 1.2\n'
NARROW = EI.replace("0.5", "0.8").replace("2.0", "1.2")


def study(bench: Bench, more: str = "", parameters: str = NARROW + MASS) -> Path:
    return bench.study(f"{parameters}{more}", test=None)


def deck_with(bench: Bench, root: float, tip: float, mass: float) -> Path:
    text = CANTILEVER.replace(
        "PBAR    1       1       1.0-3   2.0-7 ", f"PBAR,1,1,1.0-3,{2e-7 * root:.9e},5.0-7,4.0-7 $"
    )
    text = text.replace("PBAR    2       1       1.0-3   2.0-7 ", f"PBAR,2,1,1.0-3,{2e-7 * tip:.9e},5.0-7,4.0-7 $")
    return bench.write("one.bdf", text.replace("CONM2   9       5               2.0", f"CONM2,9,5,,{2.0 * mass:.9f}"))


@pytest.mark.slow
def test_runs_are_those_of_the_decks_and_effects_those_of_their_means(bench: Bench) -> None:
    found = ft.screen(study(bench, '[screen]\narray = "L18"\n'))
    assert (found.record.design, found.record.runs, found.record.error_freedom) == ("L18", 18, 11)
    table = found.runs
    assert table.shape == (18, 9)
    levels = orthogonal_array("L18").levels[:, 1:4]
    np.testing.assert_allclose(table[:, :3], 0.8 + 0.2 * levels)
    for run in (0, 7, 17):
        np.testing.assert_allclose(table[run, 3:], bench.modes(deck_with(bench, *table[run, :3])), rtol=1e-7)
    hz = table[:, 3:]
    for effect in found.record.effects:
        column = ["root", "tip", "mass"].index(effect.parameter)
        y = hz[:, effect.mode - 1]
        means = np.array([y[levels[:, column] == k].mean() for k in range(3)])
        np.testing.assert_allclose(effect.means_hz, means)
        squares = 6.0 * np.sum((means - y.mean()) ** 2)
        assert effect.contribution == pytest.approx(squares / np.sum((y - y.mean()) ** 2), abs=1e-9)


def test_bending_about_the_other_axis_depends_on_the_mass_alone(bench: Bench) -> None:
    found = ft.screen(study(bench))
    for row in found.effects:
        if row.mode in (2, 4, 6):
            assert row.contribution == pytest.approx(float(row.parameter == "mass"), abs=1e-9)
    assert found.record.sentences[0] == "More than 10 % of the variation of at least one frequency: mass, root, tip."


@pytest.mark.slow
def test_elementary_effects_and_indices_of_a_study(bench: Bench) -> None:
    """Bending about the other axis depends on the mass alone: no effect of the others, all of the variance."""
    page = bench.folder / "page.html"
    found = ft.screen(study(bench, '[screen]\ndesign = "morris"\ntrajectories = 4\n'), report=page)
    assert (found.record.design, found.record.runs) == ("Morris, 4 trajectories", 16)
    assert found.record.effects == ()
    for effect in found.record.elementary:
        if effect.mode in (2, 4, 6):
            # frequencies fall with the mass
            assert effect.absolute_hz == pytest.approx(-effect.mean_hz, abs=1e-6)
            assert (effect.absolute_hz > 1e-6) == (effect.parameter == "mass")
    assert "Elementary effects" in page.read_text()
    assert "Analysis of variance" not in page.read_text()
    # options of a call take the place of the design of the file and of its keys
    indices = ft.screen(study(bench, '[screen]\ndesign = "morris"\ntrajectories = 4\n'), design="sobol", report=page)
    assert indices.record.runs == 30
    assert [c.key for c in indices.results.citations] == ["sobol2001", "saltelli2010", "sacks1989"]
    for row in indices.record.indices:
        assert row.first_interval[0] <= row.first <= row.first_interval[1]
        if row.mode in (2, 4, 6):
            assert row.total == pytest.approx(float(row.parameter == "mass"), abs=0.03)
    assert "Sobol" in page.read_text()


@pytest.mark.slow
def test_indices_of_surrogate_and_model_agree(bench: Bench) -> None:
    on_model = ft.screen(study(bench), design="sobol", points=64, on="model")
    on_surrogate = ft.screen(study(bench), design="sobol", points=64)
    assert (on_model.record.runs, on_surrogate.record.runs) == (5 * 64, 30)
    for one, other in zip(on_model.record.indices, on_surrogate.record.indices, strict=True):
        assert one.total == pytest.approx(other.total, abs=0.01)


def test_modes_that_change_their_order_are_followed_by_their_shape(bench: Bench) -> None:
    """The two first modes bend about different axes; the stiffness of one passes that of the other."""
    wide = NARROW.replace("0.8", "0.6").replace("1.2", "4.0") + '[[parameter]]\nname = "mass"\nfields = ["CONM2 9 M"]\n'
    found = ft.screen(study(bench, '[screen]\ndesign = "factorial"\nlevels = 2\n', f"{wide}lower = 0.9\nupper = 1.1\n"))
    values, hz = found.runs[:, :3], found.runs[:, 3:]
    assert np.any(hz[:, 0] > hz[:, 1])
    # the second mode belongs to the axis that is not varied
    for mass in np.unique(values[:, 2]):
        np.testing.assert_allclose(hz[values[:, 2] == mass, 1], hz[values[:, 2] == mass, 1][0], rtol=1e-9)
    # mode 1 is stiffer where both of its halves are
    assert np.ptp(hz[:, 0]) > 10.0


@pytest.mark.slow
def test_designs_and_files(bench: Bench) -> None:
    path, csv, page = study(bench), bench.folder / "runs.csv", bench.folder / "page.html"
    found = ft.screen(path, design="plackett-burman", csv=csv, report=page)
    assert (found.record.design, found.record.runs) == ("Plackett-Burman 4", 4)
    assert found.record.error_freedom == 0
    assert [a.code for a in found.record.alerts] == ["screen.saturated"]
    assert {row.f_value for row in found.effects} == {None}
    lines = csv.read_text().splitlines()
    assert lines[0].startswith('root,tip,mass,"baseline, mode 1, Hz"')
    read = np.loadtxt(csv, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(read, found.runs)
    text = page.read_text()
    for word in ("Plackett-Burman 4", "Contributions", "not explained", "data:image/svg+xml"):
        assert word in text
    assert [c.key for c in found.results.citations] == ["montgomery2017", "plackett1946"]


@pytest.mark.slow
def test_the_modes_of_all_configurations_or_of_one(bench: Bench) -> None:
    cases = '[[configuration]]\nname = "empty"\nelements_off = [9]\n[[configuration]]\nname = "loaded"\n'
    both = ft.screen(study(bench, cases))
    assert len(both.modes) == 12
    one = ft.screen(study(bench, cases), configuration="loaded")
    assert {row.configuration for row in one.modes} == {"loaded"}
    loaded = [row.contribution for row in both.effects if row.configuration == "loaded"]
    # contributions of parameters without effect are rounding
    np.testing.assert_allclose(loaded, [row.contribution for row in one.effects], atol=1e-12)


@pytest.mark.slow
def test_runs_that_fail_are_left_out_and_named(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, at = FollowedModes.at, ft.screen(study(bench, '[screen]\narray = "L18"\n'))

    def failing(self: FollowedModes, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if np.allclose(x, [-0.2, 0.0, 0.0]):
            raise FemtuneError("eigen.no-mass", configuration="baseline")
        return whole(self, x)

    monkeypatch.setattr(FollowedModes, "at", failing)
    found = ft.screen(study(bench, '[screen]\narray = "L18"\n'))
    lost = [i + 1 for i, row in enumerate(at.runs) if np.allclose(row[:3], [0.8, 1.0, 1.0])]
    assert [f.run for f in found.record.failed] == lost
    assert "screen.failed-runs" in [a.code for a in found.record.alerts]
    assert np.isnan(found.runs[lost[0] - 1, 3:]).all()
    assert found.record.error_freedom == 11 - len(lost)
    monkeypatch.setattr(FollowedModes, "at", lambda self, x: failing(self, np.array([-0.2, 0.0, 0.0])))
    with pytest.raises(FemtuneError) as caught:
        ft.screen(study(bench))
    check_shown("screen.all-failed", caught.value)


@pytest.mark.parametrize(
    ("name", "more"),
    [
        ("screen.design", '[screen]\ndesign = "plackett-burman"\nlevels = 3\n'),
        ("screen.design, array", '[screen]\ndesign = "factorial"\narray = "L9"\n'),
        ("screen.design, key", '[screen]\ndesign = "morris"\npoints = 64\n'),
        ("screen.design, runs", '[screen]\ndesign = "sobol"\non = "model"\nruns = 50\n'),
        ("screen.unknown-configuration", '[screen]\nconfiguration = "full"\n'),
        ("screen.no-modes", '[[configuration]]\nname = "free"\nsupports_removed = ["1:6"]\n'),
    ],
)
def test_refusals(bench: Bench, name: str, more: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(bench.folder)
    path = study(bench, more)
    if name == "screen.no-modes":
        path.write_text(path.read_text().replace("count = 6", "count = 1"))
    with pytest.raises(FemtuneError) as caught:
        ft.screen(Path("study.toml"))
    check_shown(name, caught.value)


def test_alerts() -> None:
    for notice in (
        Notice("screen.failed-runs", count=2, runs="3, 8", reason="[eigen.no-mass] the model has no free mass"),
        Notice("screen.lost-modes", modes="4 (MAC 0.31)"),
        Notice("screen.interactions", modes="mode 4 (12 %)"),
        Notice("screen.saturated", runs=4),
        Notice("screen.surrogate-error", modes="mode 4 (12 %)"),
    ):
        check_shown(notice.code, notice)
