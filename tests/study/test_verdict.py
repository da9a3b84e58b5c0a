"""The verdict on a run: its reasons, its line, and data that occur twice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.reporting.whole_data import full_data

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.judge.record.acceptance import AcceptanceResults
from femtune.steps.judge.record.judgement import JudgementResults
from femtune.steps.judge.record.scatter import FrequencyScatter
from femtune.steps.judge.same_data import check_independent, counted_twice
from femtune.steps.judge.verdict import judgement
from femtune.steps.results import Results
from femtune.steps.validate.facts import scopes_of
from femtune.study.study import Study, read_study
from femtune.testdata import ModalTest

from .cantilever import Bench, bounded
from .runs_of_chain import prepared

_OTHERS = 'leave_out = [{ mode = "1", reason = "used" }, { mode = "2", reason = "used" }]'
ONE = "\n" + bounded("root", "PBAR 1 I1")


def _acceptance(**changes: Any) -> AcceptanceResults:
    given: dict[str, Any] = {"chosen": True, "standard": "own", "target_modes": ()}
    return AcceptanceResults(**{**given, "target_mass_percent": 5.0, "left_out_percent": 20.0, **changes})


def _judged(data: dict[str, Any], scatter: FrequencyScatter | None = None, **changes: Any) -> JudgementResults:
    facts = {"acceptance": _acceptance(**changes), "scatter": scatter}
    return judgement(Results.model_validate(data), {name: found for name, found in facts.items() if found})


def _weights(judged: JudgementResults) -> dict[str, str]:
    return {r.code.removeprefix("judge."): r.weight for r in judged.reasons}


def _modes(labels: str, hz: float = 10.0) -> list[dict[str, Any]]:
    return [{"test_label": m, "test_freq_hz": hz + i, "reason": "stated"} for i, m in enumerate(labels.split())]


def _bare(pairs: int, unpaired: str = "", left_out: str = "", **changes: Any) -> dict[str, Any]:
    """Results of one configuration with so many pairs and nothing else to doubt, but that nothing was held out."""
    data = full_data()
    last = next(c for c in data["correlations"] if c["stage"] == "after as written")
    pair = {**last["pairs"][0], "freq_error_percent": 0.1, "model_number": 1}
    last |= {
        "pairs": [{**pair, "test_label": f"p{i}", "test_freq_hz": 5.0 + i} for i in range(pairs)],
        "unpaired_test": _modes(unpaired), "left_out": _modes(left_out, 30.0), "unpaired_model": [], "criteria": [],
        "configuration": "BC",
    }  # fmt: skip
    keep = {key: data[key] for key in ("provenance", "study")}
    return {**keep, "correlations": [last], **changes}


@pytest.mark.parametrize(
    ("pairs", "unpaired", "targets", "weight"),
    [
        (8, "", (), None),
        (8, "a b", (), "reservation"),
        (7, "a b", (), "not accepted"),
        (7, "a b", ("p0", "p1"), "reservation"),
        (9, "a", ("a",), "reservation"),
    ],
)
def test_modes_that_were_not_compared(pairs: int, unpaired: str, targets: Any, weight: str | None) -> None:
    judged = _judged(_bare(pairs, unpaired), target_modes=targets)
    assert _weights(judged).get("modes-not-compared") == weight
    assert ("target-mode" in _weights(judged)) == ("a" in targets)
    if weight:
        said = f"{pairs} of {pairs + len(unpaired.split())} test modes"
        assert any(said in r.sentence for r in judged.reasons)
    # left out by the study or without a partner is the same to the reader
    assert _weights(_judged(_bare(pairs, "", unpaired), target_modes=targets)) == _weights(judged)


@pytest.mark.parametrize(("share", "hz", "weight"), [
    (0.06, 6.0, "not accepted"), (0.03, 6.0, "reservation"), (0.01, 6.0, None), (0.06, 60.0, None),
])  # fmt: skip
def test_a_heavy_mode_of_the_model_needs_a_partner(share: float, hz: float, weight: str | None) -> None:
    data = _bare(4)
    data["correlations"][0]["unpaired_model"] = [{"model_number": 2, "model_freq_hz": hz}]
    # rotations about the centre of gravity do not count
    masses = {"total": [1.0] * 6, "fractions": [[0.5] * 6, [0.0, share, None, 0.9, 0.9, 0.9]]}
    data["modes"] = [{
        "configuration": "BC", "stage": "after as written", "freq_hz": [5.0, hz], "rigid_body_modes": 0,
        "sturm_shift_hz": None, "sturm_count": None, "modes_below_shift": None, "effective_masses": masses,
    }]  # fmt: skip
    assert _weights(_judged(data)).get("model-mode-unpaired") == weight


def _criterion(standard: str, limit: float, verdict: str, measured: float | None = 4.0) -> dict[str, Any]:
    return {
        "name": f"frequency error, {standard}", "standard": standard, "limit": limit, "sense": "at most",
        "measured": measured, "unit": "%", "verdict": verdict, "remark": "mode 3",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("chosen", "criteria", "weight"),
    [
        (True, [_criterion("MIL-STD-1540C", 3.0, "fail")], "not accepted"),
        (False, [_criterion("MIL-STD-1540C", 3.0, "fail"), _criterion("NASA-STD-5002", 5.0, "pass")], "reservation"),
        (False, [_criterion("MIL-STD-1540C", 3.0, "fail"), _criterion("NASA-STD-5002", 3.5, "fail")], "not accepted"),
        (False, [_criterion("own criterion", 3.0, "fail"), _criterion("NASA-STD-5002", 5.0, "pass")], "not accepted"),
        # fails for modes without a partner alone: that is said already
        (True, [_criterion("NASA-STD-5002", 5.0, "fail", 4.0)], None),
    ],
)
def test_criteria_that_fail(chosen: bool, criteria: list[dict[str, Any]], weight: str | None) -> None:
    data = _bare(4)
    data["correlations"][0]["criteria"] = criteria
    judged = _judged(data, chosen=chosen)
    assert _weights(judged).get("criterion-fails") == weight
    assert ("no-standard" in _weights(judged)) == (not chosen)


def test_a_criterion_that_was_not_tested_is_a_reservation() -> None:
    data = _bare(4)
    data["correlations"][0]["criteria"] = [_criterion("NASA-STD-5002", 5.0, "not tested", None)]
    assert _weights(_judged(data))["criterion-not-tested"] == "reservation"
    assert "criterion-not-tested" not in _weights(_judged(data, chosen=False))


def _held(data: str, verdict: str = "pass") -> dict[str, Any]:
    return {
        "configuration": "heavier", "data": data, "criterion": "frequency error, NASA-STD-5002", "required": 5.0,
        "standard": "NASA-STD-5002", "sense": "at most", "measured": 7.0, "unit": "%", "verdict": verdict,
        "remark": "mode 1", "noise": "", "sentence": "",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("data", "verdict", "expected"),
    [
        ("modified structure", "pass", {}),
        ("modified structure, other boundary conditions", "pass", {}),
        ("modified structure", "fail", {"held-out-fails": "not accepted"}),
        ("modified structure", "not tested", {"nothing-held-out": "reservation"}),
        ("held-out modes", "pass", {"not-independent": "reservation"}),
        ("another test", "pass", {"not-independent": "reservation"}),
        ("same test, held out", "pass", {"not-independent": "reservation"}),
    ],
)
def test_held_out_data(data: str, verdict: str, expected: dict[str, str]) -> None:
    found = {"predictions": [], "not_tested": [], "verdicts": [_held(data, verdict)]}
    judged = _judged(_bare(4, validation=found))
    assert _weights(judged) == expected
    if not expected:
        assert judged.line == "Accepted: no check failed, and nothing was left out."


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("validation", "the FRFs that are held out were compared, but no criterion says what they must meet"),
        ("calibration", "the model was not tested on data that the update did not use"),
    ],
)
def test_held_out_functions_without_a_criterion_are_not_said_to_be_missing(data: str, said: str) -> None:
    one = {"configuration": "c", "input": "1Z+", "output": "2Z+", "data": data, "before": 1.0, "after": 0.1, "lines": 9}
    deviations = {"sums": [], "channels": [one], "sentences": []}
    found = {"predictions": [], "not_tested": [], "verdicts": [], "deviations": deviations}
    judged = _judged(_bare(4, validation=found))
    (held,) = [r for r in judged.reasons if r.code == "judge.nothing-held-out"]
    assert held.sentence == said


@pytest.mark.parametrize(
    ("error", "weight"), [(0.19, None), (0.21, "reservation"), (2.4, "reservation"), (2.6, "not accepted")]
)
def test_frequency_errors_beside_the_repeatability(error: float, weight: str | None) -> None:
    scatter = FrequencyScatter(pairs=4, error_percent=error, test_percent=0.1, limit_percent=5.0)
    assert _weights(_judged(_bare(4), scatter)).get("scatter") == weight


def test_alerts_weigh_by_their_code_and_problems_always() -> None:
    def said(level: str, code: str) -> dict[str, str]:
        return {"level": level, "code": code, "sentence": f"{code} is so"}

    alerts = [
        said("warning", "update.misfit"), said("warning", "update.at-bound"), said("problem", "write.rounding"),
        said("warning", "deck.ignored"), said("info", "update.misfit"), said("warning", "model.lumped-mass"),
        {**said("warning", "model.lumped-mass"), "sentence": "and there"},
    ]  # fmt: skip
    judged = _judged(_bare(4, alerts=alerts))
    weights = {code: w for code, w in _weights(judged).items() if code != "nothing-held-out"}
    assert weights == {
        "update.misfit": "not accepted", "update.at-bound": "reservation", "write.rounding": "reservation",
        "model.lumped-mass": "reservation",
    }  # fmt: skip
    assert judged.reasons[0].code == "update.misfit"
    assert [r.sentence for r in judged.reasons if "lumped" in r.code] == [
        "model.lumped-mass is so; and 1 more of this kind"
    ]


def test_the_line_names_the_first_reasons_and_counts_the_others() -> None:
    data = _bare(4, "a b")
    data["correlations"][0]["criteria"] = [
        {**_criterion("NASA-STD-5002", 1.0, "fail"), "name": f"quantity {i}, NASA-STD-5002"} for i in range(4)
    ]
    assert _judged(data).line == (
        "Not accepted: 4 of 6 test modes compared; quantity 0 4 % (at most 1 % required); quantity 1 4 % (at most 1 % "
        "required); quantity 2 4 % (at most 1 % required); 1 more reason."
    )


# ----------------------------------------------------------------------------------------------------
# The same data twice.


def _noisy(bench: Bench, seed: int) -> ModalTest:
    """A measurement of the true beam; another seed is a repeated measurement."""
    test = bench.measure(bench.truth())
    assert test.modes is not None
    rng = np.random.default_rng(seed)
    shapes = test.modes.shapes + 2e-3 * np.abs(test.modes.shapes).max() * rng.normal(size=test.modes.shapes.shape)
    hz = test.modes.freq_hz * (1.0 + 1e-3 * rng.normal(size=len(test.modes)))
    return replace(test, modes=ft.ModeSet(hz, shapes, test.modes.dofs))


def _copy(test: ModalTest, modes: list[int]) -> ModalTest:
    """Some modes of the test, in another order and scaled."""
    assert test.modes is not None
    part = ft.ModeSet(test.modes.freq_hz[modes], 3.7 * test.modes.shapes[:, modes], test.modes.dofs)
    return replace(test, modes=part)


def _study(bench: Bench, second: str, more: str = "") -> Study:
    first = f'[[configuration]]\nname = "a"\ntest = "bench.uff"\n{more}'
    return read_study(bench.study(f'{first}[[configuration]]\nname = "b"\n{second}\n{ONE}', test=None))


@pytest.mark.quick(2)
@pytest.mark.parametrize(
    ("second", "shared"),
    [
        ('test = "bench.uff"', "modes 1, 2, 3 and 4"),
        ('test = "copy.uff"', "modes 1, 2 and 3"),
        ('test = "part.uff"', "mode 1"),
        # other supports do not make other data of it
        ('test = "copy.uff"\nsupports_added = ["5:2"]', "modes 1, 2 and 3"),
        # one mode more than those that the update uses
        (
            'test = "bench.uff"\nleave_out = [{ mode = "1", reason = "used" }, { mode = "2", reason = "used" }]',
            "mode 3",
        ),
        ('test = "repeat.uff"', ""),
    ],
)
def test_data_of_the_update_are_no_validation_and_count_once(beam: Bench, second: str, shared: str) -> None:
    test = _noisy(beam, 1)
    beam.uff(test, "bench.uff")
    beam.uff(_copy(test, [3, 0, 2]), "copy.uff")
    beam.uff(_copy(test, [1]), "part.uff")
    beam.uff(_noisy(beam, 2), "repeat.uff")
    left = 'leave_out = [{ mode = "4", reason = "not used" }]\n' if 'mode = "1"' in second else ""
    study = _study(beam, f'{second}\nuse = "validation"', left)
    if shared:
        with pytest.raises(FemtuneError) as caught:
            check_independent(study)
        assert caught.value.code == "study.validation-used"
        assert caught.value.facts["shared"] == shared
    else:
        check_independent(study)
    twice = list(counted_twice(_study(beam, second, left)))
    assert [a.code for a in twice] == ["study.test-counted-twice"] * bool(shared)
    assert all(f"({shared})" in a.sentence for a in twice)


def test_check_refuses_data_of_the_update_for_validation(beam: Bench) -> None:
    beam.uff(_noisy(beam, 1), "bench.uff")
    for use, codes in (("validation", ["study.validation-used"]), ("update", [])):
        study = _study(beam, f'test = "bench.uff"\nuse = "{use}"')
        found = ft.check(study.file.path)
        assert [p.code for p in found.record.problems if p.level == "error"] == codes


@pytest.mark.parametrize(("upper", "warned"), [(1.4e4, []), (1.5e4, []), (1.6e4, ["k1"])])
def test_check_warns_of_bounds_beyond_the_runs(tmp_path: Path, upper: float, warned: list[str]) -> None:
    """The runs have k1 from 4,492 to 14,358; a design need not reach its bounds."""
    path = prepared(tmp_path)
    path.write_text(path.read_text().replace("upper = 1.6e4", f"upper = {upper!r}"))
    found = [r for r in ft.check(path).remarks if r.code == "study.bounds-beyond-runs"]
    assert [r.facts["parameter"] for r in found] == warned


def test_other_modes_and_channels_of_the_test_are_held_out(beam: Bench) -> None:
    test = _noisy(beam, 1)
    beam.uff(test, "bench.uff")
    used = 'leave_out = [{ mode = "3", reason = "kept" }, { mode = "4", reason = "kept" }]\n'
    study = _study(beam, f'test = "bench.uff"\n{_OTHERS}\nuse = "validation"', used)
    check_independent(study)
    assert {s.data for s in scopes_of(study)} == {"same test, held out"}
    # the sensors of one half are held out of the update, and compared by the other configuration
    assert test.modes is not None
    far = test.modes.select_dofs(test.modes.dofs.select(range(4, 8)))
    near = test.modes.select_dofs(test.modes.dofs.select(range(4)))
    beam.uff(replace(test, modes=near), "bench.uff")
    beam.uff(replace(test, modes=far), "far.uff")
    study = _study(beam, 'test = "far.uff"\nuse = "validation"')
    check_independent(study)
    assert {s.data for s in scopes_of(study)} == {"same test, held out"}


def test_records_of_one_file_are_tests_of_their_own(beam: Bench) -> None:
    beam.uff([replace(_noisy(beam, 1), name="one"), replace(_noisy(beam, 2), name="two")], "bench.uff")
    study = _study(beam, 'test = "bench.uff"\nrecords = "two"\nuse = "validation"', 'records = "one"\n')
    check_independent(study)
    assert {s.data for s in scopes_of(study)} == {"another test"}
