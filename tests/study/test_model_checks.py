"""Mass and mesh before the update: what `info`, `select` and a run say of them."""

from __future__ import annotations

from typing import Any

import pytest

from femtune import steps

Bench = Any


def _by_check(checks: Any) -> dict[str, Any]:
    return {c.check: c for c in checks}


def test_info_knows_the_mass_only(beam: Bench) -> None:
    (check,) = steps.info(beam.study()).record.checks
    assert (check.check, check.verdict) == ("weighed mass", "not tested")
    assert "no measured mass" in check.sentence


def test_select_and_run_look_at_mass_and_mesh(beam: Bench) -> None:
    study = beam.study(beam.parameters + "[checks]\nrefinement = true\nmesh_error = 0.0001")
    selected = _by_check(steps.select(study).record.model_checks)
    assert {name: c.verdict for name, c in selected.items()} == {
        "weighed mass": "not tested", "lumped or consistent mass": "fail", "mesh": "fail"}  # fmt: skip
    run = steps.run(study)
    assert _by_check(run.results.model_checks) == selected
    codes = {a.code for a in run.results.alerts}
    assert {"model.lumped-mass", "model.mesh-coarse"} <= codes
    assert not any(line.startswith("mesh convergence") for line in run.results.validation.not_tested)
    assert "Mass and mesh before the update" in run.report.read_text()


def test_the_limit_is_the_studys(beam: Bench) -> None:
    found = _by_check(
        steps.select(beam.study(beam.parameters + "[checks]\nrefinement = true\nmesh_error = 0.9")).record.model_checks
    )
    assert (found["mesh"].verdict, found["mesh"].limit) == ("pass", pytest.approx(90.0))
    assert found["mesh"].measured < -1.0


def test_without_refinement_the_mesh_is_not_tested(beam: Bench) -> None:
    found = _by_check(steps.select(beam.study()).record.model_checks)["mesh"]
    assert (found.verdict, found.measured) == ("not tested", None)
    assert "refinement = true" in found.sentence
