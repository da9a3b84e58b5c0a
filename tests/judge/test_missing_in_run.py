"""A wrong property that is no parameter is named and heals the update; a right model lacks nothing."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

import femtune as ft
from femtune.cli import main
from femtune.document.document import Paragraph
from femtune.document.figures.elements import elements_svg
from femtune.document.figures.shapes import COLOURS
from femtune.files.uff import write_uff_modes
from femtune.steps.judge.page.missing import missing_blocks
from femtune.steps.judge.reasons.missing import missing_reasons
from femtune.steps.judge.record.judgement import JudgementResults
from femtune.steps.judge.record.missing import PARAMETER, MissingField, MissingResults, RefittedField
from femtune.steps.judge.record.parts import PartsResults
from femtune.steps.judge.record.reason import ReasonRecord
from femtune.steps.results import Results
from femtune.steps.select.page import missing_of_select
from structures.wrong_property import FRAME, PLATE, WrongProperty


def _field(**more: object) -> MissingField:
    facts = {
        "field": "PSHELL 2 T", "place": "", "what": "property: thickness", "change_percent": 10.0, "increase": True,
        "lower_percent": -20.0, "upper_percent": 25.0, "f": 40.0, "share": 1.0, "degrees_of_freedom": 50.0,
        "p_value": 0.001, "lines": "[[parameter]]",
    }  # fmt: skip
    return MissingField.model_validate({**facts, **more})


def _refit(p: float | None, at_bound: bool = False) -> RefittedField:
    return RefittedField(
        factor=1.1, sd=0.01, at_bound=at_bound, converged=True, iterations=4, chi_square=90.0, p_value=p
    )  # fmt: skip


def _found(p: float, *fields: MissingField) -> list[ReasonRecord]:
    found = MissingResults(tested=40, chi_square=300.0, p_value=p, fields=fields)
    results = Results.model_construct(judgement=JudgementResults(verdict="accepted", line="", missing=found))
    return list(missing_reasons(results))


def _reasons(p: float, *fields: MissingField) -> list[tuple[str, str]]:
    return [(r.weight, r.sentence) for r in _found(p, *fields)]


def test_reason_of_a_confirmed_field() -> None:
    ((weight, said),) = _reasons(0.001, _field(refit=_refit(1e-6), alike=("MAT1 1 E", "PSHELL 4 T", "PSHELL 5 T")))
    assert weight == "not accepted"
    assert "PSHELL 2 T (or what looks like it: MAT1 1 E, PSHELL 4 T and 1 more)" in said
    assert "an increase by 10 % lowers χ² from 300 to 90" in said


def test_a_field_that_explains_one_mode_stands_beside_the_mode() -> None:
    of_one = {"mode": "8 (free)", "mode_before": 290.0, "mode_after": 60.0, "p_without_mode": 0.4}
    refit = _refit(1e-6).model_copy(update=of_one)
    (one,) = _found(0.001, _field(refit=refit))
    assert one.weight == "not accepted"
    assert one.brief == "test mode 8 (free) is doubtful, or PSHELL 2 T is wrong and is not a parameter"
    assert "an increase by 10 % lowers χ² from 300 to 90, but without this mode" in one.sentence
    (one,) = _found(0.001, _field(refit=_refit(1e-6, at_bound=True).model_copy(update=of_one)))
    assert "an increase by 10 %, the limit of its usual range, lowers χ²" in one.sentence
    mass = _field(largest_mass=0.5, mass_unit="kg", field="mass", place="at grid point 306", refit=refit)
    assert _found(0.001, mass)[0].brief == "test mode 8 (free) is doubtful, or a mass is missing at grid point 306"
    support = _field(stiffness=4e5, field="support", place="at grid point 102 in DOF 2", refit=refit)
    brief = _found(0.001, support)[0].brief
    assert brief == "test mode 8 (free) is doubtful, or the support at grid point 102 in DOF 2 gives way"


def test_what_is_not_confirmed_is_a_reservation() -> None:
    for p, field in (
        (0.001, _field()), (0.001, _field(refit=_refit(0.2))), (0.001, _field(refit=_refit(None))),
        (0.03, _field(refit=_refit(1e-6))),
    ):  # fmt: skip
        ((weight, said),) = _reasons(p, field)
        assert weight == "reservation"
        assert "PSHELL 2 T may be wrong" in said


def test_a_change_that_is_not_plausible_names_no_field() -> None:
    ((weight, said),) = _reasons(0.001, _field(change_percent=None, share=0.1))
    assert weight == "reservation"
    assert "PSHELL" not in said


def test_a_parameter_at_its_bound_is_no_missing_one() -> None:
    (one,) = _found(0.001, _field(field="spring beyond its bound", what=PARAMETER))
    assert (one.weight, one.brief) == ("reservation", "the residuals ask for spring beyond its bound")
    assert "is not a parameter" not in one.sentence


def test_the_probability_is_that_of_the_field_that_is_named() -> None:
    """Another one may be rarer by chance, and explain less by a change inside its usual range."""
    first, rarer = _field(p_value=0.033, refit=None), _field(field="PBAR 9 J", p_value=0.018, refit=None)
    (one,) = _found(0.018, first, rarer)
    assert one.place == first.name
    assert "p = 0.033" in one.sentence
    assert "0.018" not in one.sentence


def test_a_prior_that_contradicts_the_data_is_named_instead() -> None:
    """Without it nothing may be missing, so that a refit that keeps it confirms nothing."""
    parts = PartsResults(parts=(), neighbours=(), kinds=(), only_prior=True)
    found = MissingResults(tested=40, chi_square=300.0, p_value=0.001, fields=(_field(refit=_refit(1e-6)),))
    judged = JudgementResults(verdict="accepted", line="", missing=found, parts=parts)
    (one,) = missing_reasons(Results.model_construct(judgement=judged))
    assert one.weight == "reservation"


def test_reason_of_a_mass() -> None:
    """Its place and size; what a refit does not confirm is a suspicion."""
    facts = {
        "field": "mass", "place": "at grid point 306", "what": "mass that the deck does not have",
        "largest_mass": 0.5, "mass_unit": "kg", "points": (306,), "lower_percent": 0.0, "upper_percent": 100.0,
    }  # fmt: skip
    mass = _refit(1e-6).model_copy(update={"factor": 0.4})
    ((weight, said),) = _reasons(0.001, _field(**facts, refit=mass))
    assert weight == "not accepted"
    assert "a mass of about 0.2 kg is probably missing in the model at grid point 306" in said
    ((weight, said),) = _reasons(0.001, _field(**facts, alike=("mass, at grid point 7",), refit=_refit(0.2)))
    assert weight == "reservation"
    assert "at grid point 306 (or what looks like it: mass, at grid point 7)" in said
    (suspected,) = _found(0.001, _field(**facts, alike=("mass, at grid point 7",)))
    assert suspected.brief == "a mass may be missing at grid point 306"


def test_the_line_names_a_support_without_what_looks_like_it() -> None:
    facts = {
        "field": "support", "place": "at grid point 102 in DOF 2", "stiffness": 4e5, "stiffness_unit": "N/m",
        "alike": ("support at grid point 103 in DOF 2",), "lower_percent": 0.0, "upper_percent": 100.0,
    }  # fmt: skip
    (suspected,) = _found(0.03, _field(**facts))
    assert suspected.brief == "the support at grid point 102 in DOF 2 may give way"
    assert "or what looks like it" in suspected.sentence


def test_no_reason_without_a_finding() -> None:
    assert _reasons(0.06, _field()) == []
    results = Results.model_construct(judgement=JudgementResults(verdict="accepted", line=""))
    assert list(missing_reasons(results)) == []


def _run(structure: WrongProperty, folder: Path, factors: dict[str, float], **more: object) -> ft.RunResult:
    return ft.run(structure.study(folder, factors, **more))  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("structure", "wrong", "factor"),
    [(FRAME, "PBAR 2 I2", 0.8), pytest.param(PLATE, "PSHELL 2 T", 1.12, marks=pytest.mark.long)],
    ids=["frame", "plate"],
)
def test_a_wrong_property_that_is_no_parameter(
    structure: WrongProperty, wrong: str, factor: float, tmp_path: Path
) -> None:
    """The run converges to wrong values; the culprit is named, and with it as a parameter intervals have the truth."""
    result = _run(structure, tmp_path / "wrong", {wrong: factor})
    update, judged = result.results.update, result.results.judgement
    assert update is not None
    assert update.status == "CONVERGED"
    assert judged is not None
    assert judged.missing is not None
    first = judged.missing.fields[0]
    assert first.field == wrong
    assert first.increase == (factor > 1.0)
    assert first.refit is not None
    assert first.refit.sd is not None
    assert first.refit.factor == pytest.approx(factor, abs=4.0 * first.refit.sd)
    assert first.lines.splitlines()[2] == f'fields = ["{wrong}"]'
    assert judged.verdict == "not accepted"
    assert "judge.missing" in {r.code for r in judged.reasons}
    # before a run, where it is asked for: the same test at the end of a first update
    asked = ft.select(structure.study(tmp_path / "asked", {wrong: factor}), select={"missing": True}).record
    assert asked.missing is not None
    assert asked.missing.fields[0].field == wrong
    assert asked.missing.p_value == pytest.approx(judged.missing.p_value)
    shown = [block.text for block in missing_of_select(asked) if isinstance(block, Paragraph)]
    assert f'fields = ["{wrong}"]' in shown
    healed = _run(structure, tmp_path / "healed", {wrong: factor}, more=(wrong,)).results
    assert healed.update is not None
    # a few solutions without derivatives find the minimum of a whole update
    assert first.refit.chi_square == pytest.approx(healed.update.chi_square, rel=0.01)
    for p in healed.update.parameters[:-1]:
        assert p.sd is not None
        assert abs(p.value - 1.0) < 3.5 * p.sd
    # without it a value is further off than a right model would allow; what is left of the residuals widens intervals
    assert any(abs(p.value - 1.0) > 3.0 * (q.sd or np.inf) for p, q in zip(update.parameters, healed.update.parameters))
    assert healed.judgement is not None
    assert healed.judgement.missing is not None
    assert healed.judgement.missing.p_value is not None
    assert healed.judgement.missing.p_value > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("structure", [FRAME, PLATE], ids=["frame", "plate"])
def test_a_right_model_lacks_nothing(structure: WrongProperty, tmp_path: Path) -> None:
    judged = _run(structure, tmp_path, {structure.parameters[0]: 1.1}).results.judgement
    assert judged is not None
    assert judged.missing is not None
    assert judged.missing.p_value is not None
    assert judged.missing.p_value > 0.05
    assert "judge.missing" not in {r.code for r in judged.reasons}
    assert all(f.refit is None for f in judged.missing.fields)


def test_page_of_what_was_not_tested() -> None:
    class Source:
        arrays = MappingProxyType({})
        results = Results.model_construct(
            judgement=JudgementResults(verdict="accepted", line="", missing=MissingResults(reason="no elements"))
        )

    _, said = missing_blocks(Source())  # type: ignore[arg-type]
    assert said.text == "Not tested: no elements."  # type: ignore[union-attr]


def test_drawing_of_faces_lines_and_dots() -> None:
    """A triangle, a bar and a mass; what explains most has the darkest colour."""
    triangle = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]]
    bar = [[0.0, 0, 0], [0, 0, 1], [0, 0, 1], [0, 0, 1]]
    drawn = elements_svg(np.array([triangle, bar, [[0.0, 0, 1]] * 4]), np.array([0.0, 5.0, 0.0]), "least", "most")
    assert drawn.count('<path d="M') == 2
    assert drawn.count("<circle") == 1
    assert f'stroke="{COLOURS[-1]}"' in drawn
    assert f'fill="{COLOURS[0]}"' in drawn


@pytest.mark.slow
def test_a_mode_that_was_identified_badly_is_named_beside_the_field(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The model is right, and the shape of mode 6 has 0.3 of mode 5: in the terminal, in the report and in its data."""
    deck, test = tmp_path / "model.bdf", tmp_path / "test.uff"
    deck.write_text(FRAME.deck)
    right = ft.simulate(
        deck, FRAME.sensors, units="m-kg-s", count=FRAME.modes, frequency_scatter=0.003, shape_scatter=0.02, seed=1
    )
    assert right.modes is not None
    shapes = right.modes.shapes.copy()
    shapes[:, 5] += 0.3 * shapes[:, 4] * np.linalg.norm(shapes[:, 5]) / np.linalg.norm(shapes[:, 4])
    write_uff_modes(test, replace(right, modes=replace(right.modes, shapes=shapes)))
    own = "\n".join(
        f'[[parameter]]\nname = "p{i}"\nfields = ["{name}"]\nlower = 0.5\nupper = 2.0'
        for i, name in enumerate(FRAME.parameters)
    )
    (tmp_path / "study.toml").write_text(
        f'[study]\ntitle = "frame"\ndeck = "model.bdf"\nunits = "m-kg-s"\n[modes]\ncount = {FRAME.modes + 5}\n'
        f'[test]\nfile = "test.uff"\n{own}\n[residuals]\nfrequency_sd = 0.003\nshape_sd = 0.02\n'
    )
    with pytest.raises(SystemExit) as end:
        main(["run", str(tmp_path / "study.toml")])
    assert end.value.code == 4
    said = "test mode 6 (baseline) is doubtful, or a mass is missing at grid point 7"
    assert said in " ".join(capsys.readouterr().out.split())
    judged = json.loads((tmp_path / "run" / "results.json").read_text())["judgement"]
    assert said in judged["line"]
    (refit,) = (f["refit"] for f in judged["missing"]["fields"][:1])
    assert refit["mode"] == "6 (baseline)"
    assert refit["p_without_mode"] > 0.05
    first_page = (tmp_path / "run" / "report.html").read_text().partition("<h2")[0]
    assert said in first_page
