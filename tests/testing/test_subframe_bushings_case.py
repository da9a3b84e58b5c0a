"""The case of the bushings: the studies of both states, and of the free one alone, are valid."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cases.subframe_bushings.studies import Plan, study
from femtune.files.study_file import study_from_text
from structures.subframe_campaign import FREE, LOADED, Laboratory, Measured
from structures.subframe_study import Compared

TESTS = (
    Compared(FREE, Measured((60.0, 450.0)), (100.0, 390.0), (395.0, 450.0)),
    Compared(LOADED, Measured((30.0, 300.0)), (55.0, 146.0), (148.0, 160.0), (62.0, 62.2)),
)


@pytest.mark.slow
def test_the_studies_are_valid(tmp_path: Path) -> None:
    lab = Laboratory(5_000, 15, 56, 1)
    for name in ("subframe.bdf", "free.uff", "mass-loaded.uff"):
        (tmp_path / name).touch()
    plan = Plan(lab, TESTS)
    both = study_from_text(study(plan), tmp_path / "study.toml")
    assert [c.name for c in both.configuration] == ["free", "mass-loaded"]
    assert [len(c.masses) for c in both.configuration] == [0, len(lab.mesh.mounts)]
    assert [r.leave_out_modes_hz for r in both.residual] == [(), (62.0, 62.2)]
    assert [(r.from_hz, r.to_hz) for r in both.residual] == [test.band_hz for test in TESTS]
    assert [p.name for p in both.parameter] == list(lab.names)
    assert len(lab.inputs) == 1
    (held,) = both.hold_out
    assert len(held.outputs) == 21
    free = study_from_text(study(replace(plan, tests=TESTS[:1])), tmp_path / "free.toml")
    assert [c.name for c in free.configuration] == ["free"]
