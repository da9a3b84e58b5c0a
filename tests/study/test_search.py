"""A search of the whole box through the step: truth found again, χ² recomputed, failures, refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError, Notice
from femtune.residuals import UpdateProblem
from femtune.residuals.mac import mac_residual
from femtune.steps.search.front import one_less_mac
from femtune.steps.search.run import SearchResponses
from femtune.study.study import read_study

from .cantilever import EI, TRUE, Bench, bounded, measured

RESIDUALS = "\n[residuals]\nfrequency_sd = 0.01\n"
SHAPES = "\n[residuals]\nfrequency_sd = 0.01\nshape_sd = 0.05\n"
SMALL = "\n[search]\nruns = 16\nfresh_runs = 3\ninfill = 2\nseeds = 2\n"


def chi2(study: Path, values: dict[str, float]) -> float:
    """χ² of the model at parameter values, by the update problem alone."""
    loaded = read_study(study)
    x = loaded.parameters.normalise(values[p.name] for p in loaded.parameters.free)
    return 2.0 * loaded.problem().start(x).objective


@pytest.mark.slow
@pytest.mark.parametrize(
    "residuals",
    [RESIDUALS, SHAPES],
    ids=["frequencies", "principal components"],
)
def test_the_truth_is_found_on_a_surrogate(beam: Bench, residuals: str) -> None:
    path = beam.study(EI + residuals + SMALL)
    few = residuals == RESIDUALS
    found = ft.search(path, report=beam.folder / "page.html")
    record = found.record
    assert found.values == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-3)
    searched = {row.name: row.found for row in found.parameters}
    assert searched == pytest.approx({"root": 1.3, "tip": 0.85}, rel=0.02)
    assert record.chi2_initial == pytest.approx(chi2(path, {"root": 1.0, "tip": 1.0}))
    assert record.chi2_model == pytest.approx(chi2(path, searched), rel=1e-6, abs=1e-9)
    assert record.chi2 < 1e-3
    assert record.runs == 16 + 3 + 2 + 1
    assert record.surrogate is not None
    assert record.surrogate.fresh_runs == 3
    assert record.surrogate.responses == 4 if few else record.surrogate.responses <= 12
    assert record.residuals == (4 if few else 36)
    assert record.surrogate.fresh_rms is not None
    assert record.surrogate.fresh_rms < 1.0
    assert [seed.same for seed in record.seeds] == [True, True]
    history = found.history
    assert set(history[:, 0]) == {0.0, 1.0}
    assert history[-1, 2] == pytest.approx(record.chi2_searched, rel=0.5, abs=0.05)
    text = (beam.folder / "page.html").read_text()
    for word in ("Global search", "Convergence", "Leaving out a run", "root"):
        assert word in text
    assert [c.key for c in found.results.citations] == ["storn1997", "sacks1989"]


@pytest.mark.slow
def test_the_truth_is_found_on_the_model(beam: Bench) -> None:
    found = ft.search(
        beam.study(EI + RESIDUALS), on="model", method="genetic", population=16, generations=12, seeds=1
    )  # fmt: skip
    assert found.record.surrogate is None
    assert found.values == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-3)
    assert found.record.chi2_searched < 0.2 * found.record.chi2_initial
    assert found.record.chi2_searched == pytest.approx(found.record.chi2_model)
    assert found.record.runs == found.record.seeds[0].evaluations + 1


@pytest.mark.slow
def test_a_minimum_at_a_bound(beam: Bench) -> None:
    found = ft.search(beam.study(EI.replace("2.0", "1.2") + RESIDUALS + SMALL))
    assert found.values["root"] == pytest.approx(1.2)
    assert [row.at_bound for row in found.parameters] == [True, False]
    assert [a.code for a in found.record.alerts] == ["search.at-bound"]


def test_responses_give_the_residuals_and_their_squares() -> None:
    """Residuals in a space of three directions around a middle: three components, and a rest that does not change."""
    rng = np.random.default_rng(3)
    r = rng.standard_normal(40) + rng.standard_normal((25, 3)) @ rng.standard_normal((3, 40))
    responses = SearchResponses.of(r)
    c = responses.of_residuals(r)
    assert c.shape == (25, 3)
    np.testing.assert_allclose(responses.residuals(c), r, atol=1e-9)
    np.testing.assert_allclose(2.0 * responses.objective(c) + responses.rest, np.sum(r**2, axis=1))
    few = SearchResponses.of(r[:, :5])
    np.testing.assert_array_equal(few.of_residuals(r[:, :5]), r[:, :5])
    np.testing.assert_allclose(2.0 * few.objective(r[:, :5]), np.sum(r[:, :5] ** 2, axis=1))


def _failing(monkeypatch: pytest.MonkeyPatch, above: float) -> None:
    follow = UpdateProblem.follow

    def failing(self: UpdateProblem, x: np.ndarray, *more: object, **words: object) -> object:
        if x[0] > above:
            raise FemtuneError("eigen.no-mass", configuration="baseline")
        return follow(self, x, *more, **words)  # type: ignore[arg-type]

    monkeypatch.setattr(UpdateProblem, "follow", failing)


@pytest.mark.slow
def test_runs_that_fail_are_left_out_and_named(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    _failing(monkeypatch, 0.7)
    found = ft.search(beam.study(EI + RESIDUALS + SMALL))
    assert found.record.failed
    assert "search.failed-runs" in [a.code for a in found.record.alerts]
    assert found.values == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "options"), [("search.too-few", {}), ("search.all-failed", {"on": "model"})])
def test_too_many_failures(beam: Bench, monkeypatch: pytest.MonkeyPatch, name: str, options: dict[str, str]) -> None:
    _failing(monkeypatch, -0.49)
    with pytest.raises(FemtuneError) as caught:
        ft.search(beam.study(EI + RESIDUALS + SMALL), **options, generations=1, population=4)
    check_shown(name, caught.value)


@pytest.mark.slow
def test_options_are_checked_as_keys(beam: Bench) -> None:
    for options in ({"on": "table"}, {"runs": 1}, {"method": "swarm"}, {"people": 3}):
        with pytest.raises(FemtuneError):
            ft.search(beam.study(EI + RESIDUALS), **options)


def test_alerts() -> None:
    for notice in (
        Notice("search.failed-runs", count=2, reason="[eigen.no-mass] the free DOFs have no mass"),
        Notice("search.surrogate-wrong", surrogate=0.31, model="12.4"),
        Notice("search.at-bound", names="root, tip"),
        Notice("search.not-confirmed", seeds=3),
        Notice("search.infill-error", runs=20, error=0.31, wanted=0.1),
    ):
        check_shown(notice.code, notice)


FRONT = SHAPES + 'shape_form = "mac"\n' + SMALL + "front = 6\npopulation = 20\ngenerations = 25\n"


MASS = "\n" + bounded("mass", "CONM2 9 M")
STATED_MASS = """
[[residual]]
kind = "mass"
mass = 9.0
sd = 0.1
"""
THREE = "front = 6\nfront_objectives = 3\npopulation = 20\ngenerations = 15\n"


def contradictory(beam: Bench) -> str:
    """A test whose shapes belong to a root 1.3 times as stiff as in the deck, its frequencies to one as in the deck."""
    one, other = measured(beam.truth()), measured(beam.truth(TRUE[1:]))
    beam.uff([replace(one, modes=replace(one.modes, freq_hz=other.modes.freq_hz))])
    return EI


@pytest.mark.slow
def test_a_front_between_what_the_frequencies_and_what_the_shapes_say(beam: Bench) -> None:
    path = beam.study(contradictory(beam) + FRONT)
    table = beam.folder / "front.csv"
    found = ft.search(path, report=beam.folder / "page.html", csv=table)
    front = found.record.front
    assert front is not None
    assert front.label == "sum of 1 − MAC"
    # the objectives of the model, by its modes alone
    loaded = read_study(path)
    for point in front.points:
        x = loaded.parameters.normalise(point.parameters)
        blocks = loaded.problem().start(x).blocks
        errors = [b.values * b.sd for b in blocks if b.kind == "frequency"]
        roots = [1.0 / (1.0 + b.values[0] * b.sd) for b in blocks if b.kind == "MAC"]
        assert point.frequency_model == pytest.approx(np.sum(np.square(errors)), rel=1e-6, abs=1e-12)
        assert point.other_model == pytest.approx(np.sum(1.0 - np.square(roots)), rel=1e-6, abs=1e-10)
    # the surrogate knows them, and each end is better in one of the two
    frequency, other = (np.array([getattr(p, k) for p in front.points]) for k in ("frequency_model", "other_model"))
    assert frequency[0] == frequency.min() < 0.1 * front.initial_frequency
    assert other[-1] < 0.1 * other[0]
    np.testing.assert_allclose([p.frequency for p in front.points], frequency, rtol=0.1, atol=2e-5)
    np.testing.assert_allclose([p.other for p in front.points], other, rtol=0.1, atol=3e-4)
    whole = found.front
    assert np.all(np.diff(whole[:, 2]) > 0.0)
    assert np.all(np.diff(whole[:, 3]) < 0.0)
    lines = table.read_text().splitlines()
    heads = "root,tip,frequency_error_squared,other_error,frequency_error_squared_model,other_error_model"
    assert lines[0] == heads
    cells = np.array([[float(c or "nan") for c in line.split(",")] for line in lines[1:]])
    np.testing.assert_allclose(cells[:, :4], whole)
    # those of the model stand beside the points that it confirmed
    known = np.isfinite(cells[:, 4])
    np.testing.assert_allclose(cells[known, 4:], np.column_stack([frequency, other]))
    assert "Frequencies against shapes" in (beam.folder / "page.html").read_text()


@pytest.mark.slow
def test_a_front_of_three_objectives(beam: Bench) -> None:
    """Frequencies, shapes, and the weighed mass that contradicts them."""
    path = beam.study(f"{contradictory(beam)}{MASS}{SHAPES}{STATED_MASS}{SMALL}{THREE}")
    found = ft.search(path, csv=beam.folder / "front.csv", report=beam.folder / "page.html")
    front = found.record.front
    assert front is not None
    assert (front.label, front.third_label) == (
        "sum of squared errors of the shapes",
        "sum of squared errors of the rest",
    )
    k = len(found.record.parameters)
    values = found.front[:, k:]
    assert values.shape[1] == 3
    for one in values:
        assert not ((values <= one).all(axis=1) & (values < one).any(axis=1)).any()
    assert len(front.points) == 6
    loaded = read_study(path)
    problem = loaded.problem()
    before = problem.start(np.zeros(k))
    for point in front.points:
        blocks = problem.follow(loaded.parameters.normalise(point.parameters), before).blocks
        of = [np.sum([np.sum((b.values * b.sd) ** 2) for b in blocks if b.kind == kind]) for kind in
              ("frequency", "shape")]  # fmt: skip
        rest = np.sum([np.sum((b.values * b.sd) ** 2) for b in blocks if b.kind not in ("frequency", "shape")])
        model = (point.frequency_model, point.other_model, point.third_model)
        assert model == pytest.approx((*of, rest), rel=1e-6, abs=1e-12)
    assert (beam.folder / "front.csv").read_text().splitlines()[0].endswith("third_error_model")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "residuals", "csv"),
    [
        pytest.param("search.front", RESIDUALS + SMALL + "front = 3\n", False, id="frequencies alone"),
        pytest.param(
            "search.front, mac",
            SHAPES + '\n[[residual]]\nkind = "mac"\nsd = 0.1\n' + SMALL + "front = 3\n",
            False,
            id="shapes and MAC",
        ),
        pytest.param("search.front, third", SHAPES + SMALL + "front = 3\nfront_objectives = 3\n", False, id="no third"),
        pytest.param("search.front, csv", RESIDUALS + SMALL, True, id="table without a front"),
    ],
)
def test_no_front(beam: Bench, name: str, residuals: str, csv: bool) -> None:
    path = beam.study(EI + residuals)
    with pytest.raises(FemtuneError) as caught:
        ft.search(path, csv=beam.folder / "front.csv" if csv else None)
    check_shown(name, str(caught.value).replace(str(path.parent), "FOLDER"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["beam.bdf", "study.toml"])
def test_the_table_of_a_front_does_not_overwrite_an_input(beam: Bench, name: str) -> None:
    path = beam.study(contradictory(beam) + FRONT)
    before = (path.parent / name).read_bytes()
    with pytest.raises(FemtuneError) as caught:
        ft.search(path, csv=path.parent / name)
    assert caught.value.code == "write.overwrites-input"
    assert (path.parent / name).read_bytes() == before


@pytest.mark.parametrize("form", ["root", "ratio", "difference"])
def test_one_less_mac_from_each_form(form: str) -> None:
    rng = np.random.default_rng(4)
    shape, test = rng.standard_normal(5), rng.standard_normal(5)
    mac = (shape @ test) ** 2 / ((shape @ shape) * (test @ test))
    value, _ = mac_residual(shape, np.zeros((5, 1)), test, 0.05, form)  # type: ignore[arg-type]
    assert one_less_mac(0.05 * value, form)[0] == pytest.approx(1.0 - mac, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("surrogate", ["radial-basis", pytest.param("chaos", marks=pytest.mark.slow)])
def test_other_surrogates_find_the_truth(beam: Bench, surrogate: str) -> None:
    path = beam.study(EI + RESIDUALS + SMALL + f'surrogate = "{surrogate}"\n')
    found = ft.search(path, report=beam.folder / "page.html")
    assert found.values == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-3)
    assert {row.name: row.found for row in found.parameters} == pytest.approx({"root": 1.3, "tip": 0.85}, rel=0.05)
    facts = found.record.surrogate
    assert facts is not None
    assert facts.method == surrogate
    assert facts.left_out_rms < 1.0
    page = (beam.folder / "page.html").read_text()
    if surrogate == "chaos":
        assert len(facts.terms) == 4
        # first indices add up to one but for interactions, total ones exceed them
        alone, total = (
            [getattr(p, key) for p in found.record.parameters] for key in ("variance_alone", "variance_total")
        )
        assert 0.5 < sum(alone) <= 1.0 <= sum(total)
        assert "Variance alone" in page
    else:
        assert (facts.kernel, facts.trend) == ("cubic", "linear")
        assert "radial basis functions" in page
        assert "Variance alone" not in page


@pytest.mark.parametrize(
    "keys",
    ['kernel = "cubic"', 'surrogate = "chaos"\ntrend = "linear"', 'surrogate = "radial-basis"\ndegree = 3'],
)
def test_keys_of_another_surrogate_are_refused(beam: Bench, keys: str) -> None:
    path = beam.study(EI + RESIDUALS + f"\n[search]\n{keys}\n")
    with pytest.raises(FemtuneError) as caught:
        ft.search(path)
    check_shown(f"search.surrogate, {keys.splitlines()[-1]}", str(caught.value).replace(str(beam.folder), "FOLDER"))


@pytest.mark.slow
def test_the_number_of_runs_that_check_the_surrogate_is_an_argument(beam: Bench) -> None:
    record = ft.search(beam.study(EI + RESIDUALS + SMALL), fresh_runs=0, fresh=True).record
    assert record.surrogate is not None
    assert (record.surrogate.fresh_runs, record.surrogate.fresh_rms) == (0, None)


@pytest.mark.slow
def test_further_runs_by_error_end_where_the_stated_error_is_small(beam: Bench) -> None:
    by_error = '\n[search]\nruns = 10\nfresh_runs = 0\ninfill_by = "error"\ninfill = 15\nseeds = 1\n'
    path = beam.study(EI + RESIDUALS + by_error)
    whole = ft.search(path).record
    assert whole.surrogate is not None
    assert (whole.surrogate.infill_by, whole.surrogate.infill_runs, whole.surrogate.runs) == ("error", 15, 25)
    before, after = whole.surrogate.left_out_rms_before, whole.surrogate.left_out_rms
    assert before is not None
    # rounding decides which of nearly equal points comes next, so that single searches differ by factors
    others = [ft.search(path, seed=seed).record.surrogate for seed in (1, 2)]
    ratios = [s.left_out_rms / (s.left_out_rms_before or 0.0) for s in others if s is not None]
    assert np.median([after / before, *ratios]) < 0.5
    wanted = 0.9 * before
    few = ft.search(path, infill_until=wanted, report=beam.folder / "page.html").record
    assert few.surrogate is not None
    assert few.surrogate.infill_runs < 15
    assert few.surrogate.left_out_rms <= wanted
    assert "Leaving out a run before" in (beam.folder / "page.html").read_text()
    never = ft.search(path, infill=5, infill_until=1e-9)
    assert "search.infill-error" in [a.code for a in never.record.alerts]
    assert "liu2017" in [c.key for c in never.results.citations]
    with pytest.raises(FemtuneError) as caught:
        ft.search(path, infill_by="improvement", infill_until=0.1)
    check_shown("search.infill", caught.value)
    with pytest.raises(FemtuneError) as caught:
        ft.search(path, infill_by="error", on="model")
    check_shown("search.infill, on the model", caught.value)


def test_too_few_runs_are_refused_before_any_is_made(beam: Bench) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.search(beam.study(f'{EI}{RESIDUALS}\n[search]\nruns = 4\ntrend = "quadratic"\n'))
    assert caught.value.code == "search.too-few"
    assert caught.value.what.startswith("4 runs ")
    assert caught.value.what.endswith(" 8")


@pytest.mark.slow
def test_the_genetic_algorithm_of_a_study_and_other_samples(beam: Bench) -> None:
    """Crossover and mutation reach the search; without either the first generation is all there is."""
    text = EI + RESIDUALS + SMALL.replace("runs = 16\n", "") + 'sample = "central-composite"\nmethod = "genetic"\n'
    still = ft.search(beam.study(text + "population = 20\ngenerations = 5\ncrossover = 0.0\nmutation = 0.0\n"))
    assert still.record.surrogate is not None
    # corners, axial points and the centre, then the fresh runs and the infill
    assert still.record.surrogate.runs == 9 + 3 + 2
    for seed in (0.0, 1.0):
        values = still.history[still.history[:, 0] == seed, 2]
        np.testing.assert_allclose(values, values[0], rtol=1e-9)
    found = ft.search(beam.study(text + "population = 20\ncrossover = 0.8\nmutation = 0.005\n"))
    assert found.values == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-3)
