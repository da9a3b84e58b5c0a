"""GEOMCHECK statements: limits of the shapes of elements, and what info says of the elements."""

from __future__ import annotations

from pathlib import Path

import pytest

import femtune as ft
from femtune.files.nastran import read_deck
from femtune.files.nastran.geomcheck import GeometryChecks, geometry_checks
from femtune.steps.info.page import shape_blocks
from femtune.steps.info.record.model import ModelFacts

BULK = """BEGIN BULK
MAT1,1,7.+10,,.3,2700.
PSHELL,1,1,.01,1,,1
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,2.2,.5,0.
GRID,4,,1.2,.5,0.
GRID,5,,1.,1.,0.
GRID,6,,0.,1.,.3
CQUAD4,11,1,1,2,3,4
CQUAD4,12,1,1,2,5,6
ENDDATA
"""


def _deck(folder: Path, head: str) -> Path:
    (folder / "deck.bdf").write_text(f"SOL 103\n{head}CEND\n{BULK}")
    return folder / "deck.bdf"


def _checks(folder: Path, head: str) -> GeometryChecks:
    return geometry_checks(read_deck(_deck(folder, head)).executive.lines)


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        ("", GeometryChecks()),
        ("GEOMCHECK Q4_SKEW=15.0, MSGLIMIT=50\n", GeometryChecks({"Q4_SKEW": 15.0})),
        ("geomcheck q4_taper = .8, msgtype=fatal $ Q4_WARP=9.\n", GeometryChecks({"Q4_TAPER": 0.8})),
        ("GEOMCHECK Q4_SKEW=15,\n  T3_SKEW=5.\nGEOMCHECK HEX_AR=1.+1\n",
         GeometryChecks({"Q4_SKEW": 15.0, "T3_SKEW": 5.0, "HEX_AR": 10.0})),
        ("GEOMCHECK Q4_SKEW=15.0\nGEOMCHECK Q4_SKEW=20.0\n", GeometryChecks({"Q4_SKEW": 20.0})),
        ("GEOMCHECK NONE\n", GeometryChecks(off=True)),
        ("GEOMCHECK NONE\nGEOMCHECK Q4_SKEW=15.0\n", GeometryChecks({"Q4_SKEW": 15.0})),
        ("GEOMCHECK SUMMARY\n", GeometryChecks()),
        ("GEOMCHECK ADVNLELM, MSGTYPE=WARN\n", GeometryChecks()),
        ("GEOMCHECK Q4_WARP=-1.0, Q4_SKEW=0.0\n", GeometryChecks({"Q4_SKEW": 0.0}, unknown=("Q4_WARP=-1.0",))),
        ("GEOMCHECK Q9_SKEW=15.0, Q4_WARP=much\n", GeometryChecks(unknown=("Q9_SKEW=15.0", "Q4_WARP=MUCH"))),
    ],
)  # fmt: skip
def test_statements(head: str, expected: GeometryChecks, tmp_path: Path) -> None:
    assert _checks(tmp_path, head) == expected


def _facts(folder: Path, head: str) -> ModelFacts:
    return ft.info(_deck(folder, head)).record


def _beyond(facts: ModelFacts) -> dict[str, tuple[int, ...]]:
    assert facts.element_shapes is not None
    return {t.test: tuple(e.element for e in t.worst) for t in facts.element_shapes.tests if t.beyond}


def test_info_lists_elements_out_of_shape(tmp_path: Path) -> None:
    """Element 11 is a parallelogram with angles of atan(0.5/1.2) = 22.6 degrees, 12 a warped square."""
    facts = _facts(tmp_path, "")
    assert _beyond(facts) == {"Q4_SKEW": (11,), "Q4_WARP": (12,), "Q4_IAMIN": (11,), "Q4_IAMAX": (11,)}
    (table,) = shape_blocks(facts)
    rows = [[cell.text for cell in line] for line in table.rows]
    assert rows[0][0] == "Q4_SKEW"
    assert rows[0][2:] == ["≥ 30°", "1", "2", "CQUAD4 11 (22.6°)"]


def test_modes_name_the_tests_that_elements_do_not_pass(tmp_path: Path) -> None:
    (remark,) = (r for r in ft.modes(_deck(tmp_path, "GEOMCHECK Q4_WARP=.5\n"), count=7).remarks if "shape" in r.what)
    assert str(remark) == (
        "shapes of elements: of 2 elements, some are beyond the limits of Q4_SKEW, Q4_IAMIN, Q4_IAMAX; "
        "femtune info lists them"
    )


def test_limits_of_the_deck_count(tmp_path: Path) -> None:
    facts = _facts(tmp_path, "GEOMCHECK Q4_SKEW=20., Q4_WARP=.5, Q4_IAMIN=20., Q4_IAMAX=160., Q5=3\n")
    assert _beyond(facts) == {}
    (line,) = shape_blocks(facts)
    assert line.text == (
        "Shapes of elements: 2 elements, all within the limits. Limits of the deck: Q4_SKEW, Q4_WARP, Q4_IAMIN, "
        'Q4_IAMAX. Ignored words of GEOMCHECK: "Q5=3".'
    )


def test_a_deck_switches_the_tests_off(tmp_path: Path) -> None:
    (line,) = shape_blocks(_facts(tmp_path, "GEOMCHECK NONE\n"))
    assert line.text == "Shapes of elements: not tested: GEOMCHECK NONE."
