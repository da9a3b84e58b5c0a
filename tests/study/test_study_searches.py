"""Studies with regularisation, other searches and many starts: words, records, report, and runs that are resumed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.study_file.reading import study_from_text
from femtune.steps.run.result import RunResult
from femtune.steps.update.starts import STARTS_FILE

from .cantilever import Bench


def values(run: RunResult) -> dict[str, float]:
    assert run.results.update is not None
    return {p.name: p.value for p in run.results.update.parameters}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("word", "extra"),
    [
        ("distance", "weight = 100.0"),
        ("link", "weight = 100.0"),
        ("identical", 'weight = 1000.0\nidentical = [["root", "tip"]]'),
        ("truncated", "weight = 0.9"),
    ],
)
def test_every_word_holds_the_parameters_back(beam: Bench, word: str, extra: str) -> None:
    free = values(ft.update(beam.study()))
    run = ft.update(beam.study(f'{beam.parameters}[update]\nregularisation = "{word}"\n{extra}\n'))
    found, update = values(run), run.results.update
    assert update is not None
    assert update.regularisation == word
    if word == "identical":
        assert abs(found["root"] - found["tip"]) < 0.2 * abs(free["root"] - free["tip"])
    else:
        assert sum(abs(v - 1.0) for v in found.values()) < sum(abs(v - 1.0) for v in free.values())


@pytest.mark.slow
@pytest.mark.parametrize("search", ["line-search", "gauss-newton"])
def test_other_searches_end_at_the_same(beam: Bench, search: str) -> None:
    free = values(ft.update(beam.study()))
    run = ft.update(beam.study(f'{beam.parameters}[update]\nsearch = "{search}"\n'))
    assert values(run) == pytest.approx(free, abs=1e-5)
    assert run.results.update is not None
    assert "Gauss-Newton" in run.results.update.method


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["l-curve", "gcv"])
def test_a_weight_that_a_rule_finds_is_told(beam: Bench, rule: str) -> None:
    run = ft.update(beam.study(f'{beam.parameters}[update]\nregularisation = "link"\nweight = "{rule}"\n'))
    assert run.results.update is not None
    choice = run.results.update.weight_choice
    assert choice is not None
    assert choice.rule == rule
    assert len(choice.path) == 301
    assert choice.found == (choice.weight is not None)
    alerts = [a.code for a in run.results.alerts]
    assert choice.found != ("update.no-weight" in alerts)
    assert run.report is None or "norm of the side constraint" in run.report.read_text(encoding="utf-8")


@pytest.mark.slow
def test_many_starts_are_kept_told_and_not_found_twice(beam: Bench) -> None:
    text = f"{beam.parameters}[update]\nstarts = 5\nseed = 2\nhops = 1\n"
    run = ft.update(beam.study(text))
    assert values(run) == pytest.approx(values(ft.update(beam.study())), abs=1e-4)
    run = ft.update(beam.study(text))
    assert run.results.update is not None
    found = run.results.update.starts
    assert found is not None
    assert [s.number for s in found.starts] == [1, 2, 3, 4, 5]
    assert "of 5 starts" in found.sentences[0]
    path = Path(run.folder) / STARTS_FILE
    lines = path.read_text(encoding="utf-8").splitlines()
    # as if the run had been broken off in the middle of the third start
    path.write_text("\n".join([*lines[:3], lines[3][:20]]), encoding="utf-8")
    again = ft.update(beam.study(text))
    assert again.results.update is not None
    assert again.results.update.starts == found
    assert path.read_text(encoding="utf-8").splitlines()[1:3] == lines[1:3]
    # from afresh nothing of it is believed, not even what could be read
    path.write_text("\n".join([lines[0], lines[1].replace('"iterations": ', '"iterations": 99')]), encoding="utf-8")
    fresh = ft.update(beam.study(text), fresh=True)
    assert fresh.results.update is not None
    assert fresh.results.update.starts == found
    # another seed has nothing to do with them
    other = ft.update(beam.study(text.replace("seed = 2", "seed = 3")))
    assert json.loads((Path(other.folder) / STARTS_FILE).read_text().splitlines()[0]) != json.loads(lines[0])


@pytest.mark.long
def test_samples_are_kept_and_processes_give_the_same(beam: Bench) -> None:
    text = f"{beam.parameters}[update]\nstarts = 2\nsamples = 6\nseed = 2\n"
    run = ft.update(beam.study(text))
    update = run.results.update
    assert update is not None
    assert update.starts is not None
    assert update.starts.samples == 6
    # the first start is the initial values
    assert update.starts.starts[0].start == (1.0, 1.0)
    path = Path(run.folder) / STARTS_FILE
    lines = path.read_text(encoding="utf-8").splitlines()
    assert ["sample" in json.loads(line) for line in lines[1:]] == [True] * 6 + [False] * 2
    # broken off after the fifth sample
    path.write_text("\n".join(lines[:6]) + "\n", encoding="utf-8")
    again = ft.update(beam.study(text))
    assert path.read_text(encoding="utf-8").splitlines() == lines
    apart = ft.update(beam.study(f'{text}[parallel]\nhow = "processes"\nworkers = 2\n'), fresh=True)
    asked = ft.update(beam.study(text), fresh=True, jobs=2)
    assert asked.results.provenance.command == again.results.provenance.command
    for other in (again, apart, asked):
        assert other.results.update is not None
        assert other.results.update.starts == update.starts
        assert other.results.update.parameters == update.parameters


@pytest.mark.slow
def test_a_side_constraint_on_each_step(beam: Bench) -> None:
    """With enough iterations the end is that of the data, with a few it is not; the report names the constraint."""
    each = f'{beam.parameters}[update]\nregularisation = "link"\nweight = 1.0\nweight_on = "each-step"\n'
    run = ft.update(beam.study(f"{each}max_iterations = 200\n"))
    update = run.results.update
    assert update is not None
    assert update.ok
    assert update.regularisation == "link (change of each iteration)"
    assert values(run) == pytest.approx({"root": 1.3, "tip": 0.85}, abs=1e-4)
    few = ft.update(beam.study(f'{each}max_iterations = 2\nsearch = "gauss-newton"\n'))
    assert few.results.update is not None
    assert few.results.update.status == "MAX_ITERATIONS"
    assert few.report is None or "change of each iteration" in few.report.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_correlated_prior(beam: Bench) -> None:
    prior = beam.parameters.replace("upper = 2.0", "upper = 2.0\nmean = 1.1\nsd = 0.0001")
    entry = 'correlations = [{ one = "root", other = "tip", value = 0.9 }]'
    held = ft.update(beam.study(f'{prior}[update]\nregularisation = "prior"\n{entry}\n'))
    assert values(held) == pytest.approx({"root": 1.1, "tip": 1.1}, abs=0.01)


_HEAD = '[study]\ntitle = "t"\ndeck = "frame.bdf"\nunits = "m-kg-s"\n[test]\ntest = "frame.uff"\n'
_PARAMETERS = "".join(
    f'[[parameter]]\nname = "{n}"\nfields = ["PBAR {i} I1"]\nlower = 0.5\nupper = 2.0\nmean = {m}\n'
    for i, (n, m) in enumerate((("a", 1.0), ("b", 3.0)), start=1)
)


@pytest.mark.parametrize(
    ("update", "code", "word"),
    [
        ('regularisation = "link"', "study.weight", "has no effect without a weight"),
        ('regularisation = "prior"\nweight = "gcv"', "study.weight", "does not use a weight"),
        ('regularisation = "truncated"\nweight = 2.0', "study.weight", "above 0 and below 1"),
        ('regularisation = "identical"\nweight = 1.0', "study.regularisation", "needs groups"),
        ('identical = [["a", "b"]]', "study.regularisation", "is used by regularisation"),
        ('regularisation = "identical"\nweight = 1.0\nidentical = [["a", "c"]]', "update.unknown-parameter", "'c'"),
        ('regularisation = "prior"', "prior.outside-bounds", "lies outside its bounds"),
        ("adapt = true", "study.regularisation", "determined by a rule"),
        ('weight_on = "each-step"', "study.regularisation", '"minimum-change"'),
        (
            'regularisation = "identical"\nweight = 1.0\nidentical = [["a", "b"]]\nweight_on = "each-step"',
            "study.regularisation",
            '"minimum-change"',
        ),
        (
            'regularisation = "link"\nweight = 1.0\nweight_on = "each-step"\nstarts = 3',
            "study.regularisation",
            "with starts",
        ),
        (
            'regularisation = "link"\nweight = 1.0\nweight_on = "each-step"\n[reduction]',
            "study.regularisation",
            "[reduction]",
        ),
        ('regularisation = "link"\nweight = 1.0\nweight_on = "steps"', "study", "weight_on"),
        ("hops = 2", "study.starts", "several starts"),
        ('starts = 4\nfirst = "equation-error"', "study.starts", "requires reduced models"),
        ("starts = 4\nsamples = 3", "study.starts", "the best 4 starts cannot be chosen from 3 samples"),
        ("samples = 30", "study.starts", "several starts"),
    ],
)
def test_contradictions_are_told_before_anything_is_solved(tmp_path: Path, update: str, code: str, word: str) -> None:
    for name in ("frame.bdf", "frame.uff"):
        (tmp_path / name).touch()
    with pytest.raises(FemtuneError) as caught:
        study_from_text(f"{_HEAD}{_PARAMETERS}[update]\n{update}\n", tmp_path / "study.toml")
    assert code in str(caught.value)
    assert word in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "more"),
    [
        (ft.run, "[update]\nstarts = 3\n"),
        (ft.run, '[bootstrap]\nmethod = "noise"\n'),
        (ft.candidates, '[candidates]\nsubsets = "all"\n'),
        (ft.search, "[search]\n"),
        (ft.screen, "[screen]\n"),
    ],
    ids=["starts", "bootstrap", "candidates", "search", "screen"],
)
def test_a_refused_cluster_is_told_before_any_work(beam: Bench, step: Callable[..., object], more: str) -> None:
    text = f'{beam.parameters}{more}[parallel]\nhow = "cluster"\naddress = "tcp://10.0.0.7:8786"\n'
    done: list[str] = []

    class Told:
        def step(self, what: str, *_: object) -> None:
            done.append(what)

    with pytest.raises(FemtuneError) as caught:
        step(beam.study(text), progress=Told())
    assert caught.value.code == "executor.not-loopback"
    assert "parallel" in str(caught.value)
    assert not any(word in what for what in done for word in ("modes", "start", "run", "initial values"))
