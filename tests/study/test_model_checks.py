"""Mass and mesh before the update: what `info`, `select` and a run say of them."""

from __future__ import annotations

from typing import Any

import pytest

import femtune as ft
from femtune.errors import FemtuneError

from .cantilever import Bench


def _by_check(checks: Any) -> dict[str, Any]:
    return {c.check: c for c in checks}


def test_info_knows_the_mass_and_the_mesh(beam: Bench) -> None:
    found = _by_check(ft.info(beam.study()).record.checks)
    assert {name: c.verdict for name, c in found.items()} == {"weighed mass": "not tested", "mesh": "fail"}
    assert "no measured mass" in found["weighed mass"].sentence
    result = ft.modes(beam.study())
    modes = result[0]
    assert modes.mesh.modes == found["mesh"].modes
    assert [row["error_percent"] for row in result.mesh_errors] == [m.error_percent for m in modes.mesh.modes]
    for m in modes.mesh.modes:
        assert m.freq_hz == modes.freq_hz[m.mode - 1]
        assert m.converged_hz == pytest.approx(m.freq_hz / (1.0 + m.error_percent / 100.0))
    # the fourth is the last measured one
    assert min(m.error_percent for m in modes.mesh.modes[:4]) == pytest.approx(found["mesh"].measured)
    assert modes.mesh.modes[5].error_percent < found["mesh"].measured


def test_info_says_why_the_mesh_is_not_tested(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modes that cannot be solved are no reason to say nothing of the deck."""

    def no_modes(*_: object) -> None:
        raise FemtuneError("eigen.no-mass", configuration="baseline")

    monkeypatch.setattr("femtune.steps.info.checks.solve", no_modes)
    found = _by_check(ft.info(beam.study()).record.checks)["mesh"]
    assert (found.verdict, found.sentence) == ("not tested", "the modes could not be computed (eigen.no-mass)")


@pytest.mark.slow
def test_select_and_run_look_at_mass_and_mesh(beam: Bench) -> None:
    study = beam.study(beam.parameters + "[checks]\nrefinement = true\nmesh_error = 0.0001")
    selected = _by_check(ft.select(study).record.model_checks)
    assert {name: c.verdict for name, c in selected.items()} == {
        "weighed mass": "not tested", "lumped or consistent mass": "fail", "mesh": "fail"}  # fmt: skip
    run = ft.run(study)
    assert _by_check(run.results.model_checks) == selected
    codes = {a.code for a in run.results.alerts}
    assert {"model.lumped-mass", "model.mesh-coarse"} <= codes
    assert not any(line.startswith("mesh convergence") for line in run.results.validation.not_tested)
    assert "Mass and mesh before the update" in run.report.read_text()


def test_the_limit_is_the_studys(beam: Bench) -> None:
    found = _by_check(
        ft.select(beam.study(beam.parameters + "[checks]\nrefinement = true\nmesh_error = 0.9")).record.model_checks
    )
    assert (found["mesh"].verdict, found["mesh"].limit) == ("pass", pytest.approx(90.0))
    assert found["mesh"].measured < -1.0


def test_a_study_turns_the_check_of_the_mesh_off(beam: Bench) -> None:
    study = beam.study(beam.parameters + "[checks]\nrefinement = false")
    for found in (
        ft.select(study).record.model_checks,
        ft.info(study).record.checks,
        [ft.modes(study)[0].mesh],
    ):
        (check,) = (c for c in found if c.check == "mesh")
        assert (check.verdict, check.measured, check.modes) == ("not tested", None, ())
        assert check.sentence == "refinement = false in [checks]"


@pytest.mark.slow
def test_large_models_are_refined_on_request_only(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("femtune.steps.info.checks.USUAL_DOFS", 20)
    for found in (ft.info(beam.study()).record.checks, [ft.modes(beam.study())[0].mesh]):
        (check,) = (c for c in found if c.check == "mesh")
        assert check.verdict == "not tested"
        assert check.sentence.endswith("more than 20; refinement = true in [checks] computes it")
    left = [line for line in ft.run(beam.study()).results.validation.not_tested if line.startswith("mesh convergence")]
    assert left == [f"mesh convergence: {check.sentence}"]
    asked = beam.study(beam.parameters + "[checks]\nrefinement = true")
    assert _by_check(ft.info(asked).record.checks)["mesh"].measured is not None
