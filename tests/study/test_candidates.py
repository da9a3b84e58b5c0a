"""Candidate models through the step: what they reach, predictions, interrupted comparisons, refusals."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.model import Configuration
from femtune.selection.evidence import LinearFit, log_evidence
from femtune.steps.candidates.result import CandidatesResult
from femtune.steps.candidates.run import CANDIDATES_FILE, Population
from femtune.study.study import read_study
from femtune.updating.sensitivity_method import moving_parameters

from .cantilever import EI, LABELS, TRUE, Bench, bounded, measured

THREE = f"{EI}\n{bounded('mass', 'CONM2 9 M')}"
CASES = """
[[configuration]]
name = "empty"
test = "beam.uff"
records = "empty"
elements_off = [9]

[[configuration]]
name = "loaded"
test = "beam.uff"
records = "loaded"
"""
LISTED = """
[[candidate]]
name = "both"
parameters = ["root", "tip"]
note = "what is wrong"

[[candidate]]
name = "as one"
parameters = ["root"]
ties = { tip = "root" }
"""


@pytest.fixture
def two(bench: Bench) -> Bench:
    """A test of the true beam with and without its mass, with small errors of the frequencies."""
    truth, rng = bench.truth(TRUE), np.random.default_rng(2)
    tests = [
        measured(truth, name="empty", configuration=Configuration(elements_off=frozenset({9}))),
        measured(truth, name="loaded"),
    ]
    errors = [1.0 + 0.002 * rng.standard_normal(4) for _ in tests]
    bench.uff([replace(t, modes=replace(t.modes, freq_hz=t.modes.freq_hz * e)) for t, e in zip(tests, errors)])
    return bench


def study(bench: Bench, more: str, parameters: str = THREE, sd: float = 0.002) -> Path:
    return bench.study(f"{CASES}{parameters}\n[residuals]\nfrequency_sd = {sd}\n{more}", test=None)


def refused(bench: Bench, more: str, parameters: str = THREE) -> FemtuneError:
    with pytest.raises(FemtuneError) as caught:
        ft.candidates(study(bench, more, parameters))
    return caught.value


def by_name(found: CandidatesResult) -> dict[str, object]:
    return {c.name: c for c in found.record.candidates}


@pytest.mark.slow
def test_listed_candidates(two: Bench) -> None:
    found = ft.candidates(study(two, LISTED), report=two.folder / "page.html")
    models = by_name(found)
    assert list(models) == ["initial values", "both", "as one"]
    both, one = models["both"], models["as one"]
    # as the update of the same parameters alone
    alone = ft.update(study(two, "", EI), output=two.folder / "alone")
    for name in ("root", "tip"):
        assert found.values["both"][name] == pytest.approx(alone.values[name], rel=1e-6)
    assert found.values["both"]["mass"] == 1.0
    assert found.values["as one"]["tip"] == found.values["as one"]["root"]
    assert (both.admissible, one.admissible) == (True, False)
    assert (both.rank, one.rank) == (2, 1)
    assert {v.parameter: v.role for v in one.values} == {"root": "updated", "tip": "tied", "mass": "initial value"}
    assert both.probability > 0.99
    assert found.distances[1, 2] == pytest.approx(
        np.sqrt(np.mean([(found.values["both"][n] - found.values["as one"][n]) ** 2 for n in ("root", "tip", "mass")]))
    )
    page = (two.folder / "page.html").read_text(encoding="utf-8")
    assert "what is wrong" in page
    assert "Candidate models" in page


@pytest.mark.slow
def test_predictions_of_configurations_left_out(two: Bench) -> None:
    """As updates of the other configuration alone, whose model is compared with the one left out."""
    found = ft.candidates(study(two, LISTED))
    both = by_name(found)["both"]
    assert [e.configuration for e in both.left_out] == ["empty", "loaded"]
    for entry in both.left_out:
        records = f'records = "{entry.configuration}"'
        text = CASES.replace(records, f'{records}\nuse = "validation"')
        path = two.study(f"{text}{EI}\n[residuals]\nfrequency_sd = 0.002\n", test=None)
        run = ft.update(path, output=two.folder / entry.configuration)
        pairs = [
            p
            for c in run.results.correlations
            if c.stage == "after" and c.configuration == entry.configuration
            for p in c.pairs
        ]
        errors = np.array([p.freq_error_percent for p in pairs])
        assert entry.error_percent == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-4)
    assert both.prediction_percent < by_name(found)["as one"].prediction_percent


@pytest.mark.slow
def test_all_and_nested_subsets(two: Bench) -> None:
    every = ft.candidates(study(two, '[candidates]\nsubsets = "all"\nleave_one_out = false\n'))
    names = [c.name for c in every.record.candidates]
    assert names == ["initial values", "S1", "S2", "S3", "S1.2", "S1.3", "S2.3", "S1.2.3"]
    errors = {c.name: c.chi2 for c in every.record.candidates}
    assert max((c.log_evidence, c.name) for c in every.record.candidates)[1] == "S1.2"
    grown = ft.candidates(study(two, '[candidates]\nsubsets = "nested"\nleave_one_out = false\n'))
    found = {c.name: c.chi2 for c in grown.record.candidates}
    first = min(("S1", "S2", "S3"), key=lambda name: errors[name])
    seconds = [n for n in found if n.count(".") == 1]
    assert len(found) == 1 + 3 + 2 + 1
    assert all(first[1] in n for n in seconds)
    assert all(found[n] == errors[n] for n in found)
    groups = '[candidates]\nsubsets = "all"\nalways = ["mass"]\ngroups = [["root", "tip"]]\n'
    kept = ft.candidates(study(two, groups)).record.candidates
    assert [c.parameters for c in kept] == [(), ("mass", "root", "tip")]


@pytest.mark.slow
def test_an_interrupted_comparison_makes_no_run_twice(two: Bench) -> None:
    path = study(two, LISTED)
    whole = ft.candidates(path)
    file = path.parent / "run" / CANDIDATES_FILE
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    # three whole models, and two configurations left out of each
    assert len(lines) == 1 + 3 + 6
    file.write_text("".join(lines[:5]) + lines[5][:20], encoding="utf-8")
    again = ft.candidates(path)
    assert again.record == whole.record
    assert sorted(file.read_text(encoding="utf-8").splitlines(keepends=True)) == sorted(lines)
    # a candidate more is one run more and its predictions; another test begins anew
    more = LISTED + '\n[[candidate]]\nname = "root alone"\nparameters = ["root"]\n'
    ft.candidates(study(two, more))
    assert len(file.read_text(encoding="utf-8").splitlines()) == len(lines) + 3
    ft.candidates(study(two, LISTED, sd=0.004))
    assert len(file.read_text(encoding="utf-8").splitlines()) == len(lines)


@pytest.mark.slow
def test_a_candidate_that_is_interrupted_among_its_starts_keeps_them(two: Bench) -> None:
    path = study(two, LISTED + "\n[candidates]\nstarts = 3\nleave_one_out = false\n")
    whole = ft.candidates(path)
    file = path.parent / "run" / CANDIDATES_FILE
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    # the key, the initial values, and three starts of two candidates
    assert len(lines) == 1 + 1 + 6
    file.write_text("".join(lines[:4]), encoding="utf-8")
    made: list[int] = []

    def tell(text: str, done: int, total: int | None) -> None:
        if text == "updates of candidate models":
            made.append(done)

    again = ft.candidates(path, progress=SimpleNamespace(step=tell))
    assert again.record == whole.record
    # three of seven are known, and each of the others is told of
    assert made == [3, 4, 5, 6, 7]
    assert sorted(file.read_text(encoding="utf-8").splitlines(keepends=True)) == sorted(lines)


@pytest.mark.long
def test_several_starts_and_processes_give_the_same(two: Bench) -> None:
    asked = '[candidates]\nsubsets = "all"\nmost = 1\nstarts = 2\nleave_one_out = false\n'
    one = ft.candidates(study(two, asked))
    assert all(c.starts == 2 for c in one.record.candidates[1:])
    assert by_name(one)["S1"].starts_at_best == 2
    many = ft.candidates(study(two, asked + '[parallel]\nhow = "processes"\nworkers = 2\n'), fresh=True)
    assert many.record == one.record


@pytest.mark.slow
def test_combinations_that_the_data_leave_open(two: Bench) -> None:
    """Modulus and density of the bare beam have the same effect; of one configuration none is left out."""
    fields = {"E": "MAT1 1 E", "rho": "MAT1 1 RHO"}
    free = [bounded(name, field) for name, field in fields.items()]
    candidate = '[[candidate]]\nname = "E and rho"\nparameters = ["E", "rho"]\n'
    bare = CASES.partition('\n[[configuration]]\nname = "loaded"')[0]
    found = ft.candidates(two.study("\n".join([bare, *free, candidate]), test=None))
    record = by_name(found)["E and rho"]
    assert (record.rank, len(record.undetermined), record.left_out) == (1, 1, ())
    shares = {s.parameter: s.coefficient for s in record.undetermined[0].shares}
    # both change in proportion, so that their ratio stays
    values = found.values["E and rho"]
    assert shares["E"] / shares["rho"] == pytest.approx(values["E"] / values["rho"], rel=1e-6)
    assert record.status == "UNDETERMINED"


def told(found: CandidatesResult, code: str) -> None:
    """One alert of the code, in the wording of its page."""
    (alert,) = [a for a in found.record.alerts if a.code == code]
    check_shown(code, f"[{alert.code}] {alert.sentence}")


ONE = '[[candidate]]\nname = "both"\nparameters = ["root", "tip"]\n[candidates]\nleave_one_out = false\n'


@pytest.mark.slow
def test_candidates_at_bounds_and_not_converged(two: Bench) -> None:
    narrow = EI.replace("upper = 2.0", "upper = 1.1")
    found = ft.candidates(study(two, ONE + "[reduction]\n", narrow))
    told(found, "candidates.at-bound")
    told(found, "candidates.full-model")
    assert [v.parameter for v in by_name(found)["both"].values if v.at_bound] == ["root"]
    told(ft.candidates(study(two, ONE + "[update]\nmax_iterations = 1\n", EI)), "candidates.not-converged")


@pytest.mark.slow
def test_candidates_that_pair_other_modes_or_none(two: Bench) -> None:
    """Their ties make the model wrong or too soft from the beginning."""
    wrong = '[[candidate]]\nname = "wrong"\nparameters = ["mass"]\nties = { root = "-1*mass" }\n'
    found = ft.candidates(study(two, ONE + wrong))
    told(found, "candidates.failed")
    assert by_name(found)["wrong"].values == ()
    assert found.distances.shape == (2, 2)
    other = '[[candidate]]\nname = "other"\nparameters = ["mass"]\nties = { root = "0.3*mass" }\n'
    found = ft.candidates(study(two, ONE + other))
    told(found, "candidates.other-residuals")
    assert by_name(found)["other"].bic is None


@pytest.mark.slow
def test_two_equally_good_optima(bench: Bench) -> None:
    """A beam that is clamped at both ends has the same frequencies with its halves exchanged."""
    truth = bench.truth(TRUE)
    held = Configuration(supports_added=((5, "123456"),))
    bench.uff(measured(truth, LABELS[:6], configuration=held))
    clamped = '[[configuration]]\nname = "clamped"\ntest = "beam.uff"\nsupports_added = ["5:123456"]\n'
    more = "starts = 8\n[correlate]\nmac_gate = 0.2\n[residuals]\nfrequency_sd = 0.002\n"
    found = ft.candidates(bench.study(f"{clamped}{EI}{ONE}{more}", test=None))
    told(found, "candidates.not-unique")
    both = by_name(found)["both"]
    assert (both.starts, both.other_optima) == (8, 1)
    assert 0 < both.starts_at_best + both.starts_unpaired < 8


@pytest.mark.quick(0)
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("candidates.none", ""),
        ("candidates.unknown", '[[candidate]]\nname = "a"\nparameters = ["rot"]\n'),
        ("candidates.tied", '[[candidate]]\nname = "a"\nparameters = ["root"]\nties = { root = "tip" }\n'),
        ("candidates.twice", '[candidates]\nsubsets = "all"\nalways = ["root"]\ngroups = [["root", "tip"]]\n'),
        ("candidates.sizes", '[candidates]\nsubsets = "all"\nleast = 3\nmost = 2\n'),
        ("candidates.sizes, groups", '[candidates]\nsubsets = "all"\nleast = 4\n'),
        ("candidates.name", '[[candidate]]\nname = "initial values"\nparameters = ["root"]\n'),
        (
            "candidates.name, subset",
            '[candidates]\nsubsets = "all"\n[[candidate]]\nname = "S1.2"\nparameters = ["root"]\n',
        ),
        ("candidates.twice, parameters", '[[candidate]]\nname = "a"\nparameters = ["root", "root"]\n'),
        ("tie.circle, candidate", '[[candidate]]\nname = "a"\nparameters = ["root"]\nties = { tip = "tip" }\n'),
        ("candidates.too-many", '[candidates]\nsubsets = "all"\nlargest_number = 5\n'),
        (
            "candidates.stages",
            '[candidates]\nsubsets = "all"\n[[stage]]\nname = "s"\nparameters = ["root"]\nresiduals = ["frequency"]\n',
        ),
    ],
)
def test_refusals(two: Bench, name: str, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    error = refused(two, text)
    monkeypatch.chdir(two.folder)
    assert error.code == name.partition(",")[0]
    check_shown(name, str(error).replace(str(two.folder), "…"))


def test_a_tie_without_a_value_is_named(two: Bench) -> None:
    error = refused(two, '[[candidate]]\nname = "a"\nparameters = ["root"]\nties = { tip = "1/(root-root)" }\n')
    assert error.code == "tie.value"
    assert error.where is not None


SEARCHED = '[candidates]\nleave_one_out = false\nstarts = 3\nsearch = "genetic"\npopulation = 10\ngenerations = 5\n'


@pytest.mark.long
def test_starts_from_random_populations(two: Bench) -> None:
    """Every search ends in the valley of the minimum, which an update of the same parameters finds too."""
    found = ft.candidates(study(two, LISTED + SEARCHED))
    alone = ft.update(study(two, "", EI), output=two.folder / "alone")
    both, one = (by_name(found)[name] for name in ("both", "as one"))
    assert found.values["both"] == pytest.approx({**alone.values, "mass": 1.0}, rel=1e-6)
    for model in (both, one):
        assert (model.starts, model.starts_at_best, model.starts_unpaired) == (3, 3, 0)


@pytest.mark.slow
def test_a_population_is_judged_by_the_residuals_of_the_update(two: Bench) -> None:
    """χ² with the other parameters at their initial values, and infinite where the model cannot be solved."""
    loaded = read_study(study(two, LISTED))
    problem = loaded.problem()
    moving = moving_parameters(problem, ("root", "tip"))
    population = Population(problem, problem.start(np.zeros(3)), moving)
    points = np.array([[0.1, -0.2], [0.0, 0.3], [-2.0, 0.0]])
    chi2 = population(points)
    for point, value in zip(points[:2], chi2):
        assert value == pytest.approx(2.0 * problem.start(np.array([*point, 0.0])).objective, rel=1e-9)
    assert not np.isfinite(chi2[2])


@pytest.mark.slow
def test_another_search_begins_anew(two: Bench) -> None:
    small = SEARCHED.replace("= 10", "= 4").replace("= 5", "= 1").replace("starts = 3", "starts = 1")
    path = study(two, LISTED + small)
    ft.candidates(path)
    file = path.parent / "run" / CANDIDATES_FILE
    first = file.read_text(encoding="utf-8").splitlines()
    ft.candidates(study(two, LISTED + small.replace("generations = 1", "generations = 2")))
    second = file.read_text(encoding="utf-8").splitlines()
    assert len(first) == len(second)
    assert first[0] != second[0]


@pytest.mark.slow
def test_instances_that_are_not_falsified(two: Bench) -> None:
    """All that is left keeps the limit, contains the truth, and predicts the frequencies of both configurations."""
    found = ft.candidates(study(two, f"[candidates]\ninstances = 300\nleave_one_out = false\n{LISTED}"))
    models = by_name(found)
    both, one, none = (models[name].instances for name in ("both", "as one", "initial values"))
    assert none is None
    # one parameter cannot be right for both ends
    assert (one.kept, one.kept_near, one.drawn_near, one.parameters) == (0, 0, 0, ())
    assert (both.drawn, both.drawn_near) == (300, 300)
    assert both.kept_near > 30
    true = {"root": 1.3, "tip": 0.85}
    for interval in both.parameters:
        assert interval.lower < true[interval.parameter] < interval.upper, interval
    rows = found.arrays[both.instances_key]
    assert rows.shape == (both.kept + both.kept_near, 2 + len(both.predictions))
    assert {p.configuration for p in both.predictions} == {"empty", "loaded"}
    path = study(two, "")
    loaded = read_study(path)
    problem = loaded.problem()
    before = problem.start(np.zeros(3))
    for row in rows[:: max(1, len(rows) // 8)]:
        at = problem.follow(loaded.parameters.normalise(np.array([*row[:2], 1.0])), before)
        assert np.abs(at.residuals).max() <= found.record.limit * (1.0 + 1e-9)
        first = [np.sqrt(state.solution.eigenvalues[0]) / (2.0 * np.pi) for state in at.states]
        ours = [row[2 + j] for j, p in enumerate(both.predictions) if p.mode == 1]
        assert ours == pytest.approx(first, rel=1e-6)


@pytest.mark.slow
def test_instances_by_the_mean_error(two: Bench) -> None:
    text = f"[candidates]\ninstances = 200\nthreshold = 1.5\nleave_one_out = false\n{LISTED}"
    found = ft.candidates(study(two, text), report=two.folder / "page.html")
    both = by_name(found)["both"].instances
    assert both.kept_near > 20
    assert "Instances that are not falsified" in (two.folder / "page.html").read_text(encoding="utf-8")
    assert any("instances of both" in sentence for sentence in found.record.sentences)


SAMPLED = '[candidates]\nevidence = "sampled"\nleave_one_out = false\n[posterior]\ndraws = 200\n'


def evidence(found: CandidatesResult) -> dict[str, float]:
    """Logarithms of the sampled evidence by candidate, in the units of the linear one."""
    return {c.name: c.sampled_log_evidence or np.nan for c in found.record.candidates}


@pytest.mark.slow
def test_the_sampled_evidence_is_the_linear_one_where_the_data_are_strong(two: Bench) -> None:
    found = ft.candidates(study(two, SAMPLED + LISTED))
    both, constant = evidence(found), -0.5 * 8 * np.log(2.0 * np.pi)
    for c in found.record.candidates:
        assert c.not_sampled == ""
        assert both[c.name] == pytest.approx((c.log_evidence or np.nan) + constant, abs=0.15)
        assert c.sampled_probability == pytest.approx(c.probability, abs=0.03)
    assert not any(a.code.startswith("candidates.linear") for a in found.record.alerts)
    # each configuration left out: the ratio of evidences with and without it
    alone = {}
    for name, kept in (("empty", "loaded"), ("loaded", "empty")):
        part = CASES[CASES.index(f'[[configuration]]\nname = "{kept}"') :].split("\n\n", maxsplit=1)[0]
        more = f"{part}\n{THREE}\n[residuals]\nfrequency_sd = 0.002\n{SAMPLED}{LISTED}"
        alone[name] = evidence(ft.candidates(two.study(more, test=None)))
    for c in found.record.candidates:
        if c.parameters:
            assert [one.configuration for one in c.left_out_evidence] == ["empty", "loaded"]
            for one in c.left_out_evidence:
                assert one.log_density == pytest.approx(both[c.name] - alone[one.configuration][c.name], abs=0.4)


WIDE = "".join(
    f'[[parameter]]\nname = "{name}"\nfields = ["{field}"]\nlower = 0.05\nupper = 20.0\n'
    for name, field in (("root", "PBAR 1 I1"), ("tip", "PBAR 2 I1"), ("mass", "CONM2 9 M"))
)
THREE_LISTED = '\n[[candidate]]\nname = "three"\nparameters = ["root", "tip", "mass"]\n'


@pytest.mark.slow
def test_a_linear_evidence_that_is_wrong_is_told(two: Bench) -> None:
    """With wide bounds and errors of 20 % all three parameters together leave a curved ridge."""
    found = ft.candidates(study(two, SAMPLED + LISTED + THREE_LISTED, WIDE, sd=0.2))
    (doubt,) = [a for a in found.record.alerts if a.code == "candidates.linear-evidence"]
    assert "beside as one" in doubt.sentence or "beside initial values" in doubt.sentence
    assert re.search(r"three \(-1\.\d\)", doubt.sentence)
    # others may be off by as much
    sentence = re.sub(
        r"beside .*, its", "beside initial values, its", re.sub(r"one for .*", "one for three (-1.3)", doubt.sentence)
    )
    check_shown("candidates.linear-evidence", f"[{doubt.code}] {sentence}")


@pytest.mark.slow
def test_samples_that_do_not_hold_are_told(two: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise FemtuneError("posterior.not-sampled", reason="the weights do not support it")

    monkeypatch.setattr("femtune.steps.candidates.run.sampled_evidence", refuse)
    found = ft.candidates(study(two, SAMPLED + LISTED))
    told = [a for a in found.record.alerts if a.code == "candidates.not-sampled"]
    assert [c.name for c in found.record.candidates if c.not_sampled] == ["both", "as one"]
    check_shown("candidates.not-sampled", f"[{told[0].code}] {told[0].sentence}")


@pytest.mark.slow
def test_an_integral_that_is_not_found_leaves_no_evidence(two: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = log_evidence

    def lost(chi2: float, fit: LinearFit, size: float = 1.0) -> float:
        return float("nan") if len(fit.slope) == 2 else whole(chi2, fit, size)

    monkeypatch.setattr("femtune.selection.candidate_models.log_evidence", lost)
    found = ft.candidates(study(two, LISTED), report=two.folder / "page.html")
    both = by_name(found)["both"]
    assert (both.log_evidence, both.probability) == (None, None)
    assert sum(c.probability or 0.0 for c in found.record.candidates) == pytest.approx(1.0)
    assert any("the evidence as one" in s for s in found.record.sentences)
    told = [a for a in found.record.alerts if a.code == "candidates.no-evidence"]
    check_shown("candidates.no-evidence", f"[{told[0].code}] {told[0].sentence}")


@pytest.mark.slow
def test_a_size_of_the_errors_that_few_data_leave_unknown_is_told(two: Bench) -> None:
    """Four frequencies and three parameters: an evidence with a stated size is no evidence beside an estimated one."""
    part = CASES[: CASES.index('[[configuration]]\nname = "loaded"')]
    more = f'{part}\n{THREE}\n[residuals]\nfrequency_sd = 0.002\nscatter = "estimated"\n{SAMPLED}{LISTED}{THREE_LISTED}'
    found = ft.candidates(two.study(more, test=None))
    told = {c.name: c.not_sampled for c in found.record.candidates if c.not_sampled}
    assert list(told) == ["both", "three"]
    check_shown("posterior.few-degrees", f"[posterior.few-degrees] {told['both']}")
