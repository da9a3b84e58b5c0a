"""The live model that a run leaves: right at points that nobody has solved before, and refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.reporting.html import html_text
from femtune.steps.live.record import LiveConfiguration
from femtune.steps.live.stored import stored_model
from femtune.steps.report.build import build_report
from femtune.steps.run.result import RunResult

from .cantilever import CANTILEVER, Bench, bounded, fine, modes_of_deck, with_factors

pytestmark = pytest.mark.slow

_EI = f"\n{bounded('root', 'PBAR 1 I1')}\n{bounded('tip', 'PBAR 2 I1')}\n"


def _worst(run: RunResult, folder: Path, text: str, count: int) -> tuple[float, float]:
    """Largest error of a frequency at ten random points, beside decks of their own, and what the record says of it."""
    live = run.results.live
    assert live is not None
    assert live.reason == ""
    (one,) = live.configurations
    model, errors = stored_model(live, one.configuration, run.arrays), []
    for i, (root, tip) in enumerate(np.random.default_rng(7).uniform(0.5, 2.0, (10, 2)).round(3)):
        deck = folder / f"point_{i}.bdf"
        deck.write_text(with_factors(text, root, tip), encoding="ascii")
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
    assert (one.dofs, one.order) == (24, 24)
    assert one.region is not None
    assert (one.region.compared_with, one.region.compared_order) == ("full model", 24)
    assert (one.region.points, one.bounds.points, one.bounds.corners) == (50, 54, 4)
    # every pair at every point
    assert (one.region.mac_pairs, one.bounds.mac_pairs) == (50 * len(one.pairs), 54 * len(one.pairs))
    assert one.bounds.chi_square_percent is not None
    assert one.bounds.chi_square_percent < 1e-2
    assert one.region_full is one.bounds_full is None
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


def _square(one: LiveConfiguration, run: RunResult, freq_hz: np.ndarray, shapes: np.ndarray) -> dict[str, float]:
    """Sum of squares by kind, from the record alone: single modes, shapes of unit norm or scaled to the test's."""
    tests, mode, out = run.arrays[one.test_shapes_key], {p.test: p.mode for p in one.pairs}, dict[str, float]()
    for part in one.parts:
        psi, hz = tests[:, part.test], freq_hz[mode[part.test]] / one.test_freq_hz[part.test]
        if part.quantity == "frequency":
            values = np.array([(hz if part.form == "frequency" else hz**2) - 1.0])
        else:
            assert (part.quantity, part.form, part.weights_first) == ("shape", "unit-norm", None)
            phi = shapes[:, mode[part.test]]
            values = np.sign(phi @ psi) * phi / np.linalg.norm(phi) - psi / np.linalg.norm(psi)
        out[part.kind] = out.get(part.kind, 0.0) + float(np.sum((values / part.sd) ** 2))
    return out


def test_chi_square_of_the_page_is_that_of_the_update(bench: Bench) -> None:
    text = "[residuals]\nfrequency_sd = 0.002\nshape_sd = 0.01\n"
    # with masses that the test has not, so that there is something to sum up
    bench.write("light.bdf", CANTILEVER.replace("       2.0\nSPC1", "       1.5\nSPC1"))
    run = ft.run(bench.study(f"{_EI}\n{text}", deck="light.bdf"), output=bench.folder / "light")
    live, update = run.results.live, run.results.update
    assert live is not None
    assert update is not None
    assert update.goodness is not None
    assert live.others == ()
    (one,) = live.configurations
    modes = stored_model(live, one.configuration, run.arrays)
    found = modes.modes(modes.at)
    squares = _square(one, run, found.freq_hz, run.arrays[one.sensors_key] @ found.shapes)
    # at the optimum the parameters can change nothing of the residuals: the test of the fit has all of them
    assert set(squares) == {k.kind for k in update.goodness.by_kind} == {"frequency", "shape"}
    assert min(squares.values()) > 1.0
    assert sum(squares.values()) == pytest.approx(update.goodness.chi_square, rel=1e-4)


def test_an_added_mass_is_that_of_a_deck_with_it(small: RunResult, bench: Bench) -> None:
    live = small.results.live
    assert live is not None
    (one,) = live.configurations
    assert one.mass_points == ("grid 2", "grid 3", "grid 4", "grid 5")
    rows = small.arrays[one.mass_rows_key or ""][1]
    text = with_factors(CANTILEVER, 1.5, 0.75).replace("SPC1 ", "CONM2   10      3               1.5\nSPC1 ")
    deck = bench.write("heavy.bdf", text)
    found = stored_model(live, one.configuration, small.arrays).modes(np.array([0.5, -0.25]), np.sqrt(1.5) * rows)
    np.testing.assert_allclose(found.freq_hz, modes_of_deck(deck, one.count)[0], rtol=1e-5)


def test_a_mass_on_a_reduced_live_model_is_that_of_a_deck_with_it(bench: Bench) -> None:
    text = fine(20)
    bench.write("twenty.bdf", text)
    deck = bench.write("truth/twenty.bdf", with_factors(text, 1.3, 0.85))
    bench.uff(bench.measure(deck, *(f"{n}{d}+" for n in range(3, 22, 2) for d in "YZ")), "twenty.uff")
    run = ft.run(bench.study(_EI, deck="twenty.bdf", test="twenty.uff"), output=bench.folder / "twenty")
    live = run.results.live
    assert live is not None
    (one,) = live.configurations
    assert one.order < one.dofs == 120
    assert len(one.mass_points) == 8
    assert live.solutions == 0
    # criteria of orthogonality can follow too
    assert one.reduced_mass is not None
    assert len(one.reduced_mass.sensors) == 20
    assert one.reduced_mass.points == 11
    assert one.reduced_mass.difference < 1e-3
    assert _worst_with_masses(run, bench, text) < 1e-4


def _worst_with_masses(run: RunResult, bench: Bench, text: str) -> float:
    """Largest relative error of a frequency with 0.09 to 2.5 times the mass of the beam, beside decks with it."""
    live, worst = run.results.live, 0.0
    assert live is not None
    (one,) = live.configurations
    model = stored_model(live, one.configuration, run.arrays)
    for k, mass in ((0, 0.7), (4, 3.0), (7, 20.0)):
        point = one.mass_points[k].removeprefix("grid ")
        heavy = with_factors(text, 1.4, 0.7).replace("SPC1 ", f"CONM2   77      {point:<8s}        {mass}\nSPC1 ")
        rows = np.sqrt(mass) * run.arrays[one.mass_rows_key or ""][k]
        found = model.modes(np.array([0.4, -0.3]), rows).freq_hz
        exact = modes_of_deck(bench.write(f"heavy_{k}.bdf", heavy), one.count)[0]
        worst = max(worst, float(np.abs(found / exact - 1.0).max()))
    return worst


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
    text = fine(48)
    bench.write("fine.bdf", text)
    live = ft.run(bench.study(_EI, deck="fine.bdf"), output=bench.folder / "unasked").results.live
    assert live is not None
    assert live.reason.startswith(
        "the model has 288 degrees of freedom and was not reduced for the update; `live = true`"
    )
    assert live.configurations == ()


@pytest.mark.parametrize("more", ["[output]\nlive = true\n", "[reduction]\n"])
def test_a_mass_on_a_larger_model_is_that_of_a_deck_with_it(bench: Bench, more: str) -> None:
    """Far from the update, where the static responses in the basis are those of other parameters."""
    text = fine(48)
    bench.write("many.bdf", text)
    deck = bench.write("truth/many.bdf", with_factors(text, 1.3, 0.85))
    bench.uff(bench.measure(deck, *(f"{n}{d}+" for n in range(3, 50, 4) for d in "YZ")), "many.uff")
    run = ft.run(
        bench.study(f"{_EI}\n{more}", deck="many.bdf", test="many.uff"), output=bench.folder / f"many_{len(more)}"
    )
    live = run.results.live
    assert live is not None
    assert len(live.configurations[0].mass_points) == 8
    assert _worst_with_masses(run, bench, text) < 1e-4


@pytest.mark.parametrize("more", ["[output]\nlive = true\n", "[reduction]\n"])
def test_larger_models_are_reduced_and_checked(bench: Bench, more: str) -> None:
    text = fine(48)
    bench.write("fine.bdf", text)
    run = ft.run(bench.study(f"{_EI}\n{more}", deck="fine.bdf"), output=bench.folder / f"larger_{len(more)}")
    live = run.results.live
    assert live is not None
    (one,) = live.configurations
    assert one.bounds.compared_with == "reduced model"
    assert one.order <= one.bounds.compared_order < one.dofs == 288
    assert len(one.mass_points) == 4
    assert one.mass_reason == ""
    assert one.reduced_mass is None
    # what was compared with the full model was solved for it
    assert one.region_full is not None
    assert one.bounds_full is not None
    assert (one.bounds_full.compared_with, one.bounds_full.compared_order) == ("full model", 288)
    assert (one.region_full.points, one.bounds_full.points) == (4, 4)
    assert one.bounds_full.corners >= 1
    assert live.solutions == 8 + (12 if "output" in more else 0)
    worst, _ = _worst(run, bench.folder, text, one.count)
    assert worst < 2.0 * one.bounds_full.frequency_percent + 1e-4
    assert one.bounds_full.frequency_percent < 0.1


def _wide(name: str, field: str, lower: float, upper: float) -> str:
    return f'[[parameter]]\nname = "{name}"\nfields = ["{field}"]\nlower = {lower}\nupper = {upper}\n'


def test_a_mechanism_has_no_modes(bench: Bench) -> None:
    """Without stiffness at the root there is no frequency, also not one of rounding."""
    study = bench.study(_wide("root", "PBAR 1 I1", 0.0, 3.0) + _wide("tip", "PBAR 2 I1", 0.5, 2.0))
    run = ft.run(study, output=bench.folder / "mechanism")
    live = run.results.live
    assert live is not None
    assert live.reason == live.narrowed == ""
    (one,) = live.configurations
    model = stored_model(live, one.configuration, run.arrays)
    with pytest.raises(np.linalg.LinAlgError):
        model.modes(np.array([-1.0, 0.0]))
    assert len(model.modes(np.array([-0.9, 0.0])).freq_hz) == one.count
    # the two corners at which the full model has none either are counted
    assert (one.bounds.corners, one.bounds.without_modes) == (4, 2)
    assert one.bounds.frequency_percent < 0.1


def test_a_function_that_no_polynomial_follows_narrows_the_sliders(bench: Bench) -> None:
    """1/x over bounds of ratio 2e5 needs a degree of thousands; about the 95 % region it does not."""
    tie = '[[parameter]]\nname = "tip"\nfields = ["PBAR 2 I1"]\ntie = "1.1/root"\n'
    study = bench.study(_wide("root", "PBAR 1 I1", 1e-4, 20.0) + tie)
    run = ft.run(study, output=bench.folder / "steep")
    live = run.results.live
    assert live is not None
    assert live.narrowed == (
        "a coefficient of its matrices changes with root between the bounds too sharply for a polynomial of degree 224"
    )
    (p,) = live.parameters
    assert p.interval_95 is not None
    assert 1e-4 < p.lower < p.interval_95[0] < p.updated < p.interval_95[1] < p.upper < 20.0
    (one,) = live.configurations
    assert one.bounds.frequency_percent < 1e-3
    page = html_text(build_report(run.results, run.arrays))
    assert "The sliders end before the bounds: a coefficient of its matrices" in page
    assert "ranges of the sliders" in page


def test_pairs_of_rigid_body_modes_are_left_out(bench: Bench) -> None:
    """Their frequencies are rounding: no two programs find the same ones."""
    free = CANTILEVER.replace("SPC = 1\n", "").replace("SPC1    1       123456  1\n", "")
    bench.write("free.bdf", free)
    bench.uff(bench.measure(bench.write("truth/free.bdf", free.replace("2.0-7 ", "2.5-7 ", 1)), count=9), "free.uff")
    study = bench.study(_EI, deck="free.bdf", test="free.uff")
    study.write_text(study.read_text().replace("count = 6", "count = 10"))
    run = ft.run(study, output=bench.folder / "free")
    live = run.results.live
    assert live is not None
    assert live.reason == ""
    (one,) = live.configurations
    assert one.pairs
    model = stored_model(live, one.configuration, run.arrays)
    freq_hz = model.modes(model.at).freq_hz
    assert min(freq_hz) < 1.0
    assert min(freq_hz[p.mode] for p in one.pairs) > 10.0
    assert {p.test for p in one.parts} <= {p.test for p in one.pairs}


def test_a_rejected_fit_is_told_to_the_page(bench: Bench) -> None:
    """What the data allow is not said of an update whose residuals are no noise."""
    residuals = "[residuals]\nfrequency_sd = 0.0001\nshape_sd = 0.01\n"
    bench.write("off.bdf", CANTILEVER.replace("7850.", "8300."))
    run = ft.run(bench.study(f"{_EI}\n{residuals}", deck="off.bdf"), output=bench.folder / "rejected")
    update = run.results.update
    assert update is not None
    assert update.goodness is not None
    assert update.goodness.verdict == "fail"
    assert '"rejected":true' in html_text(build_report(run.results, run.arrays))


def test_a_fit_that_holds_is_no_rejected_one(small: RunResult) -> None:
    assert '"rejected":false' in html_text(build_report(small.results, small.arrays))
