"""The benchmark of the judge: its truth is the truth, its rates are what they say, and a sample of its models."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import femtune as ft

_FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "judge"
_MODULES = ("decks", "trials", "measure", "opinion", "rates", "page", "run")


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
    """The modules of the benchmark, whose names other benchmarks have too."""
    path, before = list(sys.path), {name: sys.modules.pop(name, None) for name in _MODULES}
    sys.path.insert(0, str(_FOLDER))
    yield {name: importlib.import_module(name) for name in _MODULES}
    sys.path[:] = path
    for name, module in before.items():
        sys.modules.pop(name, None)
        if module is not None:
            sys.modules[name] = module


@pytest.mark.slow
@pytest.mark.parametrize("number", [5, *(pytest.param(number, marks=pytest.mark.long) for number in (1, 2, 3, 4, 6))])
def test_a_right_model_without_noise_is_recovered(modules: dict[str, ModuleType], number: int, tmp_path: Path):
    trials = modules["trials"]
    one = trials.trial("right", number)
    trials.write_data(one, tmp_path, trials.Deviations(0.0, 0.0, 0.0))
    found = ft.update(trials.write_study(one, tmp_path, trials.NOISE, "noise-free"))
    for parameter in found.results.update.parameters:
        # the file of the test has six digits
        assert abs(parameter.value - one.truth[parameter.name.replace("_", " ")]) < 0.02 * parameter.sd
    assert found.results.update.chi_square < 1e-2


def test_wrong_models_differ_in_what_is_not_updated(modules: dict[str, ModuleType]):
    trials, structures = modules["trials"], modules["decks"].STRUCTURES
    for number in range(36):
        for kind in ("candidate", "hidden"):
            one = trials.trial(kind, number)
            assert one == trials.trial(kind, number)
            assert one.structure is structures[number % 6]
            field, factor = one.fault.field, one.fault.factor
            assert field not in one.structure.parameters
            assert (field in one.structure.values) == (kind == "candidate")
            model, true = (one.structure.deck(c).splitlines() for c in ({}, {field: factor}))
            assert model != true


def test_a_rate_meets_its_limit_inside_its_interval_or_beside_it(modules: dict[str, ModuleType]):
    rates = modules["rates"]
    # Clopper and Pearson: 8 of 100 is 3.5 to 15.2 %, 12 of 100 is 6.4 to 20.0 %
    eight, twelve = rates.Rate(8, 100), rates.Rate(12, 100)
    assert eight.interval == pytest.approx((0.0352, 0.1516), abs=1e-4)
    assert twelve.interval == pytest.approx((0.0636, 0.2002), abs=1e-4)
    assert rates.Criterion("", eight, most=0.05).met
    assert not rates.Criterion("", eight, most=0.05).inside
    assert not rates.Criterion("", twelve, most=0.05).met
    assert rates.Criterion("", twelve, least=0.2).met
    assert not rates.Criterion("", twelve, least=0.25).met
    assert rates.Criterion("", twelve, least=0.05, most=0.2).inside
    assert rates.Criterion("", twelve, least=0.05).decided
    # 0 of 10 is 0 to 31 %: no proof of a rate of 5 %, and 0 of 10 is far from 97 %
    assert not rates.Criterion("", rates.Rate(0, 10), most=0.05).decided
    assert rates.Criterion("", rates.Rate(0, 10), least=0.97).decided


def test_an_interrupted_run_goes_on_where_it_ended(modules: dict[str, ModuleType], tmp_path: Path):
    run, path = modules["run"], tmp_path / "models.jsonl"
    run.keep(path, {"kind": "right", "number": 3, "seed": 1})
    with path.open("a") as out:
        out.write('{"kind": "right", "numb')
    run.keep(path, {"kind": "hidden", "number": 0, "seed": 1})
    run.keep(path, {"kind": "right", "number": 4, "seed": 2})
    assert list(run.known(path, seed=1)) == [("right", 3), ("hidden", 0)]
    jobs = run.jobs_of(4)
    assert len(jobs) == len(set(jobs)) == 8
    assert sum(kind == "right" for kind, _ in jobs) == 4


def test_a_run_that_is_stopped_early_is_balanced(modules: dict[str, ModuleType]):
    run, structures = modules["run"], [s.name for s in modules["decks"].STRUCTURES]
    jobs = run.jobs_of(500)
    assert len(jobs) == len(set(jobs)) == 1000
    for first in range(0, 996, 12):
        some = jobs[first : first + 12]
        for wrong in (False, True):
            assert [structures[n % 6] for kind, n in some if (kind != "right") == wrong] == structures
        assert sum(kind == "hidden" for kind, _ in some) == 3
    for first in range(0, 984, 24):
        some = jobs[first : first + 24]
        assert {(kind, n % 6) for kind, n in some} == {
            (k, n) for k in ("right", "candidate", "hidden") for n in range(6)
        }


def test_harm_is_not_excused_by_intervals_that_a_misfit_widens(modules: dict[str, ModuleType]):
    run = row("candidate", [3.5], 0.001, [])["runs"]["true"]
    run["parameters"][0]["sd"] = 1.0
    assert modules["opinion"].harmful(run)


def test_no_test_finds_more_than_the_one_that_knows_the_culprit(modules: dict[str, ModuleType]):
    most_power, visible = modules["opinion"].most_power, modules["opinion"].VISIBLE
    assert most_power(0.0) == pytest.approx(0.05)
    # z ± sqrt(5) beside 1.96
    assert most_power(5.0) == pytest.approx(0.6088, abs=1e-3)
    assert most_power(visible - 1.0) < 0.97 < most_power(visible)


@pytest.mark.slow
def test_the_signal_of_an_error_is_what_an_update_to_exact_data_leaves(modules: dict[str, ModuleType], tmp_path: Path):
    trials = modules["trials"]
    # a mass of the plate that is 9 % off; the parameters take most of its effect
    one = trials.trial("candidate", 13)
    trials.write_data(one, tmp_path, trials.EXACT)
    study = trials.write_study(one, tmp_path, trials.NOISE, "noise-free")
    left = ft.update(study, update={"look_further": False}).results.update.chi_square
    assert modules["measure"].signal_of(one, tmp_path) == pytest.approx(left, rel=0.1)
    assert modules["measure"].signal_of(trials.trial("right", 1), tmp_path) is None


@pytest.mark.slow
def test_the_judge_on_a_sample_of_models(modules: dict[str, ModuleType]):
    measure, opinion = modules["measure"], modules["opinion"]
    right = [measure.measured("right", number, 1, ["true"])["runs"]["true"] for number in (6, 7)]
    wrong = [measure.measured("candidate", number, 1, ["default"])["runs"]["default"] for number in (0, 6)]
    # with a level of 1 % each, the three tests refuse both right models with a probability of 0.001
    assert sum(opinion.refused(run) for run in right) <= 1
    # four to six parameters each, 95 % intervals
    hits = [hit for run in right for hit in opinion.covered(run)]
    assert sum(hits) >= 0.8 * len(hits)
    assert all(opinion.found_by(run, "missing parameter") for run in wrong)
    fields = ("PBAR 3 I2", "PBAR 4 I2")
    assert [opinion.rank_of(run, field) for run, field in zip(wrong, fields)] == [1, 1]


def row(kind: str, misses: list[float], p: float, reasons: list[dict[str, str]], **more: object) -> dict[str, object]:
    """Of a model whose parameters miss by so many standard deviations."""
    parameters = [{"true": 1.0, "value": 1.0 + 0.1 * z, "sd": 0.1, "stated_sd": 0.1, "at_bound": "",
                   "interval": [1.0 + 0.1 * z - 0.196, 1.0 + 0.1 * z + 0.196]} for z in misses]  # fmt: skip
    verdict = "not accepted" if any(r["weight"] == "not accepted" for r in reasons) else "accepted with reservations"
    run = {
        "status": "CONVERGED", "ok": True, "chi_square": 10.0, "compared": 9, "parameters": parameters,
        "goodness": {"p": p, "verdict": ""}, "judgement": {"verdict": verdict, "reasons": reasons} | more,
        "seconds": 1.0,
    }  # fmt: skip
    fault = None if kind == "right" else ["PSHELL 4 T", 1.1]
    return {"kind": kind, "number": 0, "seed": 1, "structure": "plate", "fault": fault, "runs": {"true": run},
            "signal": None if kind == "right" else 20.0, "revision": "abc"}  # fmt: skip


def test_rates_of_the_page_are_counted_from_rows(modules: dict[str, ModuleType]):
    page, opinion = modules["page"], modules["opinion"]
    misfit = {"code": next(iter(opinion.TESTS.values()))[0], "weight": "not accepted", "sentence": "", "place": ""}
    other = {"code": "judge.held-out-none", "weight": "reservation", "sentence": "", "place": ""}
    rows = [
        row("right", [0.5, -2.5], 0.3, [other]),
        row("right", [0.1, 1.0], 0.3, [misfit]),
        row("candidate", [3.5, 0.0], 0.001, [misfit]),
        row("candidate", [-3.5, 0.0], 0.3, [other]),
        row("candidate", [2.5, 0.0], 0.3, [misfit]),
        row("hidden", [4.0, 5.0], 0.3, [misfit]),
    ]
    found = page.COLUMNS["any of the three"]
    assert page.level(rows, "true", found) == modules["rates"].Rate(1, 2)
    assert page.power(rows, "true", "candidate", found) == modules["rates"].Rate(1, 2)
    assert page.power(rows, "true", "candidate", opinion.found_today) == modules["rates"].Rate(1, 2)
    assert page.power(rows, "true", "hidden", found) == modules["rates"].Rate(1, 1)
    assert page.coverage(page.runs(rows, "true", "right")) == modules["rates"].Rate(3, 4)
    rows[3]["signal"] = 5.0
    assert page.power(page.visible(rows), "true", "candidate", found) == modules["rates"].Rate(1, 1)
    nominal = {"chi_square": 10.0, "compared": 9}
    ends = [{"chi_square": 8.5, "compared": 9}, {"chi_square": 9.5, "compared": 9}, {"chi_square": 5.0, "compared": 8}]
    started = [{"structure": "plate", "nominal": nominal, "starts": end} for end in ends]
    # of other residuals χ² cannot be compared
    assert page.better_minima(started) == modules["rates"].Rate(1, 2)
    text = page.page(rows, started, 12)
    assert "**Incomplete: 6 of 12 models are measured.**" in text
    assert "1 of 2" in text
    assert "| 0 to 8 | 1 | 60.9 % | 0.0 % (0 of 1) | 0.0 % (0 of 1) |" in text
