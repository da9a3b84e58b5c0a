"""What is told of supports, constraints and rigid motions, each DOF counted where it is held."""

from __future__ import annotations

from pathlib import Path

import pytest

import femtune as ft
from femtune.steps.info.record.model import ModelConfiguration
from femtune.steps.report_source import ReportSource
from femtune.steps.run.page.summary import model_summary
from structures import subframe

_HEAD = "SOL 103\nCEND\n{case}BEGIN BULK\n"
_BEAM = """GRID,1,,0.,0.,0.,,123456
GRID,2,,1.,0.,0.,,4
GRID,3,,2.,0.,0.
GRID,4,,2.,1.,0.
GRID,5,,9.,1.,0.
PBAR,1,1,1.-3,2.-7,5.-7,4.-7
MAT1,1,2.1+11,,.3,7850.
CBAR,1,1,1,2,0.,0.,1.
CBAR,2,1,2,3,0.,0.,1.
RBE2,9,3,123456,4
SPC1,7,46,2,3
SPC,7,1,3,0.
EIGRL,1,,,2
"""


def _facts(folder: Path, case: str = "SPC = 7\n", more: str = "") -> ModelConfiguration:
    path = folder / "beam.bdf"
    path.write_text(_HEAD.format(case=case) + _BEAM + more + "ENDDATA\n")
    return ft.info(path).record.configurations[0]


def test_each_dof_is_counted_where_it_is_held(tmp_path: Path) -> None:
    found = _facts(tmp_path)
    # 24 of grid 2 and 13 of grid 1 are held by these themselves
    assert found.supports == ("grid points themselves (PS): 7 DOFs", "SPC set 7: 3 DOFs")
    assert found.constraints == ("rigid elements: 6 equations",)
    assert {h.dof[0] for h in found.held_dofs} == {"5"}
    assert found.grids * 6 == found.free_dofs + 7 + 3 + 6 + len(found.held_dofs)


def test_overlays_change_the_counts(tmp_path: Path) -> None:
    _facts(tmp_path)
    study = tmp_path / "study.toml"
    study.write_text(
        '[study]\ntitle = "T"\ndeck = "beam.bdf"\nunits = "m-kg-s"\n[modes]\ncount = 2\n'
        '[[configuration]]\nname = "a"\nsupports_added = ["3:12"]\nsupports_removed = ["3:6", "2:4"]\n'
        "elements_off = [9]\n"
    )
    (found,) = ft.info(study).record.configurations
    # 4 of grid 2 was held twice, and is free now
    assert found.supports == ("grid points themselves (PS): 6 DOFs", "SPC set 7: 2 DOFs", "configuration: 2 DOFs")
    assert found.constraints == ()


def test_stiffness_to_the_ground_that_no_element_has_is_a_fault(tmp_path: Path) -> None:
    more = "DMIG,KK,0,6,1,0\nDMIG,KK,3,1,,3,1,5.+6\n"
    check = _facts(tmp_path, "SPC = 7\nK2GG = KK\n", more).rigid_body_check
    assert (check.verdict, check.grounded, check.grounding_elements) == ("fail", True, ())
    assert check.sentence.startswith("without supports, rigid-body motion X")
    assert check.sentence.endswith(" constrained to ground")
    assert check.worst_dofs[0].dof == "3X+"


@pytest.fixture(scope="module")
def deck(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("subframe") / "sub.bdf"
    subframe.main(["5000", str(path)])
    return path


@pytest.mark.slow
def test_a_free_structure_of_shells_and_solids_is_called_free(deck: Path) -> None:
    found = ft.modes(deck, count=7)
    results, arrays = found.results, found.arrays
    assert results.model is not None
    (found,) = results.model.configurations
    check = found.rigid_body_check
    assert (check.verdict, check.grounded, check.worst_dofs) == ("pass", False, ())
    assert check.sentence == "without supports, all six rigid-body motions are free of strain"
    assert (found.supports, results.modes[0].rigid_body_modes) == ((), 6)
    numbers = {n.name: n for n in model_summary(ReportSource(results, arrays))[0].numbers}  # type: ignore[union-attr]
    supports = numbers["Supports"]
    assert supports.before == "free"
    assert supports.remark == f"AUTOSPC: {len(found.held_dofs)} DOFs; {found.constraints[0]}"
