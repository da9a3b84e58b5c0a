"""The mass in the live model: that of decks, beside a weighed one, with its part of χ²."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.reporting.devtools import CHROMIUM

import femtune as ft
from femtune.steps.live.record import LiveMass
from femtune.steps.run.result import RunResult

from .answering import answering_page
from .cantilever import CANTILEVER, Bench, bounded

pytestmark = pytest.mark.slow

_PARAMETERS = bounded("root", "PBAR 1 I1") + bounded("density", "MAT1 1 RHO") + bounded("tip_mass", "CONM2 9 M")
_WEIGHED = '[[residual]]\nkind = "mass"\nmass = 9.0\nsd = 0.02\n[[residual]]\nkind = "frequency"\nsd = 0.01\n'
_BARS, _TIP = 7.85, 2.0
"""Mass of a metre of bars of 10 cm², and of the mass at its end."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    made = Bench(tmp_path_factory.mktemp("live_mass"))
    made.write("beam.bdf", CANTILEVER)
    made.uff(made.measure(made.truth()))
    return made


@pytest.fixture(scope="module")
def weighed(bench: Bench) -> RunResult:
    return ft.run(bench.study(f"{_PARAMETERS}\n{_WEIGHED}"), output=bench.folder / "weighed")


def _mass(run: RunResult) -> LiveMass | None:
    assert run.results.live is not None
    assert run.results.live.reason == ""
    (one,) = run.results.live.configurations
    return one.mass


def test_the_mass_is_followed_and_its_residual_is_computed(weighed: RunResult) -> None:
    mass, live = _mass(weighed), weighed.results.live
    assert mass is not None
    assert live is not None
    values = {p.name: p.updated for p in live.parameters}
    assert mass.updated == pytest.approx(_BARS * values["density"] + _TIP * values["tip_mass"], rel=1e-9)
    (one,) = mass.weighed
    assert (one.mass, one.sd) == (9.0, pytest.approx(0.18))
    assert live.others == ()


def test_a_mass_that_no_parameter_changes_is_not_followed(bench: Bench) -> None:
    study = bench.study(f"{bounded('root', 'PBAR 1 I1')}\n{_WEIGHED}")
    run = ft.run(study, output=bench.folder / "constant")
    assert _mass(run) is None
    assert run.results.live is not None
    assert [o.kind for o in run.results.live.others] == ["mass"]


def test_without_a_weighed_mass_it_is_followed_alone(bench: Bench) -> None:
    run = ft.run(bench.study(_PARAMETERS), output=bench.folder / "alone")
    mass = _mass(run)
    assert mass is not None
    assert mass.weighed == ()
    assert len(mass.slopes) == sum(t.kind == "mass" for t in run.results.live.configurations[0].terms)  # type: ignore[union-attr]


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
def test_the_page_shows_the_mass_and_its_part_of_chi_square(weighed: RunResult, tmp_path: Path) -> None:
    with answering_page(weighed, tmp_path) as found:
        for density, tip in ((1.2, 0.8), (0.6, 1.9), (2.0, 0.5)):
            found.set([1.1, density, tip])
            total = _BARS * density + _TIP * tip
            text = found.text(".totalmass")
            assert text.startswith(f"Mass of the model: now {total:.5g} kg, updated ")
            assert f"; weighed 9 kg, {100.0 * (total / 9.0 - 1.0):+.3g}".replace("-", "−") in text
            assert text.endswith(" % (standard deviation 2 %).")
            square = ((total - 9.0) / 0.18) ** 2
            assert float(found.rows("χ² of all configurations")["mass"][1]) == pytest.approx(square, rel=1e-3)
