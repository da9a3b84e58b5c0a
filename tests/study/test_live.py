"""The live model that a run leaves: right at points that nobody has solved before, and refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.reporting.html import html_text
from femtune.steps.live.stored import stored_model
from femtune.steps.report.build import build_report
from femtune.steps.run.result import RunResult

from .cantilever import CANTILEVER, Bench, bounded, modes_of_deck

pytestmark = pytest.mark.slow

_ROOT, _TIP = ("1.0-3   2.0-7   5.0-7   4.0-7           $ root", "1.0-3   2.0-7   5.0-7   4.0-7           $ tip")
_EI = f"\n{bounded('root', 'PBAR 1 I1')}\n{bounded('tip', 'PBAR 2 I1')}\n"


def _fine(elements: int) -> str:
    """The cantilever as a mesh of bars."""
    grids = "".join(f"GRID    {i + 1:<8d}        {i / elements:<8.5f}0.0     0.0\n" for i in range(elements + 1))
    bars = "".join(
        f"CBAR    {i:<8d}{1 + (2 * i > elements):<8d}{i:<8d}{i + 1:<8d}0.0     1.0     0.0\n"
        for i in range(1, elements + 1)
    )
    return (
        f"SOL 103\nCEND\nSPC = 1\nBEGIN BULK\n{grids}MAT1    1       2.1+11          0.3     7850.\n"
        f"PBAR    1       1       {_ROOT}\nPBAR    2       1       {_TIP}\n{bars}"
        f"CONM2   99      {elements + 1:<8d}        2.0\nSPC1    1       123456  1\nENDDATA\n"
    )


def _with(text: str, root: float, tip: float) -> str:
    for old, factor in ((_ROOT, root), (_TIP, tip)):
        assert old in text
        text = text.replace(old, old.replace("2.0-7   ", f"{2.0 * factor:.3f}-7 ", 1))
    return text


def _worst(run: RunResult, folder: Path, text: str, count: int) -> tuple[float, float]:
    """Largest error of a frequency at ten random points, beside decks of their own, and what the record says of it."""
    live = run.results.live
    assert live is not None
    assert live.reason == ""
    (one,) = live.configurations
    model, errors = stored_model(live, one.configuration, run.arrays), []
    for i, (root, tip) in enumerate(np.random.default_rng(7).uniform(0.5, 2.0, (10, 2)).round(3)):
        deck = folder / f"point_{i}.bdf"
        deck.write_text(_with(text, root, tip), encoding="ascii")
        errors.append(
            np.abs(model.modes(np.array([root, tip]) - 1.0).freq_hz / modes_of_deck(deck, count)[0] - 1.0).max()
        )
    return 100.0 * max(errors), one.bounds.frequency_percent


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    made = Bench(tmp_path_factory.mktemp("live"))
    made.write("beam.bdf", CANTILEVER)
    made.uff(made.measure(made.truth()))
    return made


@pytest.fixture(scope="module")
def small(bench: Bench) -> RunResult:
    return ft.run(bench.study(_EI), output=bench.folder / "small")


def test_a_small_model_needs_no_solutions_and_is_right_everywhere(small: RunResult, bench: Bench) -> None:
    live = small.results.live
    assert live is not None
    assert live.solutions == 0
    (one,) = live.configurations
    assert (one.compared_with, one.dofs, one.order) == ("full model", 24, 24)
    assert one.region is not None
    assert one.region.points == one.bounds.points == 50
    worst, said = _worst(small, bench.folder, CANTILEVER, one.count)
    assert worst < 1e-4
    assert said < 1e-4


def test_the_updated_point_is_the_centre(small: RunResult) -> None:
    live = small.results.live
    assert live is not None
    assert small.results.update is not None
    (one,) = live.configurations
    modes = stored_model(live, one.configuration, small.arrays)
    after = next(m for m in small.results.modes if m.stage == "after")
    np.testing.assert_allclose(modes.modes(modes.at).freq_hz, after.freq_hz, rtol=1e-9)
    assert {p.name: p.updated for p in live.parameters} == {p.name: p.value for p in small.results.update.parameters}


def test_chi_square_of_the_page_is_that_of_the_update(small: RunResult) -> None:
    live, update = small.results.live, small.results.update
    assert live is not None
    assert update is not None
    assert live.others == ()
    assert {p.kind for p in live.configurations[0].parts} == {c.kind for c in update.residual_counts}


def test_an_added_mass_is_that_of_a_deck_with_it(small: RunResult, bench: Bench) -> None:
    live = small.results.live
    assert live is not None
    (one,) = live.configurations
    assert one.mass_points == ("grid 2", "grid 3", "grid 4", "grid 5")
    rows = small.arrays[one.mass_rows_key or ""][1]
    text = _with(CANTILEVER, 1.5, 0.75).replace("SPC1 ", "CONM2   10      3               1.5\nSPC1 ")
    deck = bench.write("heavy.bdf", text)
    found = stored_model(live, one.configuration, small.arrays).modes(np.array([0.5, -0.25]), np.sqrt(1.5) * rows)
    np.testing.assert_allclose(found.freq_hz, modes_of_deck(deck, one.count)[0], rtol=1e-5)


def test_the_edge_of_the_region_is_a_sphere_in_its_own_coordinates(small: RunResult) -> None:
    live = small.results.live
    assert live is not None
    assert live.region is not None
    region = live.region
    rows, offset, at, centre, precision = (
        small.arrays[k]
        for k in (region.rows_key, region.offset_key, region.at_key, region.centre_key, region.precision_key)
    )
    for u in np.random.default_rng(1).standard_normal((10, len(centre))):
        x = centre + u * np.sqrt(region.radius_square / (u @ precision @ u))
        assert np.sum((rows @ (x - at) + offset) ** 2) == pytest.approx(region.limit, rel=0.02)


def test_samples_of_the_linearised_distribution_carry_their_sum_of_squares(small: RunResult) -> None:
    live = small.results.live
    assert live is not None
    assert live.draws is not None
    assert live.region is not None
    assert (live.draws.source, live.draws.reason) == ("linear", "")
    x, q = small.arrays[live.draws.x_key], small.arrays[live.draws.linear_key or ""]
    rows, offset, at = (small.arrays[k] for k in (live.region.rows_key, live.region.offset_key, live.region.at_key))
    np.testing.assert_allclose(np.sum(((x - at) @ rows.T + offset) ** 2, axis=1), q, rtol=1e-9)
    assert 0.85 < np.mean(q <= live.region.limit) <= 1.0


def test_a_sampled_posterior_takes_the_place_of_the_linearised_distribution(bench: Bench) -> None:
    residuals = "[residuals]\nfrequency_sd = 0.002\nshape_sd = 0.01\n"
    study = bench.study(f'{_EI}\n{residuals}[posterior]\nnoise = "stated"\ndraws = 200\nstarts = 0\n')
    run = ft.run(study, output=bench.folder / "sampled")
    live, posterior = run.results.live, run.results.posterior
    assert live is not None
    assert live.draws is not None
    assert posterior is not None
    assert live.draws.source == "posterior"
    x = run.arrays[live.draws.x_key]
    samples = run.arrays[posterior.samples_key]
    assert x.shape == (20, 2)
    # parameters of a nominal value of one
    assert all(np.abs(samples - (1.0 + one)).max(axis=1).min() < 1e-12 for one in x)


def test_the_page_lets_a_worker_start_only_if_it_has_a_live_model(small: RunResult, bench: Bench) -> None:
    page = html_text(build_report(small.results, small.arrays))
    assert page.count("worker-src blob:") == 1
    without = small.results.model_copy(update={"live": None})
    assert "worker-src" not in html_text(build_report(without, small.arrays))


def test_it_can_be_refused(bench: Bench) -> None:
    study = bench.study(f"{_EI}\n[output]\nlive = false\n")
    assert ft.run(study, output=bench.folder / "never").results.live is None


def test_a_larger_model_is_not_made_unasked(bench: Bench) -> None:
    text = _fine(48)
    bench.write("fine.bdf", text)
    live = ft.run(bench.study(_EI, deck="fine.bdf"), output=bench.folder / "unasked").results.live
    assert live is not None
    assert live.reason.startswith(
        "the model has 288 degrees of freedom and was not reduced for the update; `live = true`"
    )
    assert live.configurations == ()


@pytest.mark.parametrize("more", ["[output]\nlive = true\n", "[reduction]\n"])
def test_larger_models_are_reduced_and_checked(bench: Bench, more: str) -> None:
    text = _fine(48)
    bench.write("fine.bdf", text)
    run = ft.run(bench.study(f"{_EI}\n{more}", deck="fine.bdf"), output=bench.folder / f"larger_{len(more)}")
    live = run.results.live
    assert live is not None
    (one,) = live.configurations
    assert one.compared_with == "reduced model"
    assert one.order <= one.compared_order < one.dofs == 288
    assert one.reduced_error_percent is not None
    assert bool(live.solutions) == ("output" in more)
    worst, said = _worst(run, bench.folder, text, one.count)
    assert worst < 2.0 * (said + one.reduced_error_percent) + 1e-4
    assert said < 0.1
