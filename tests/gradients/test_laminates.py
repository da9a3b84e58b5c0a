"""Every ply's thickness and angle and every modulus as parameters: matrices with derivatives by complex steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.model import Assignment, Configuration, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from femtune.testing import check_matrix_derivatives

HEAD = """SOL 103
CEND
BEGIN BULK
MAT8,4,1.4+11,1.+10,.3,5.+9,4.+9,3.+9,1600.
MAT1,1,2.1+11,,.3,7850.
GRID,1,,0.,0.,0.,,123456
GRID,2,,1.,.1,.05
GRID,3,,1.1,.9,0.
GRID,4,,0.,1.,0.,,123456
GRID,5,,2.,0.,.1
CQUAD4,1,1,1,2,3,4,20.
CTRIA3,2,1,2,5,3
"""
OBLIQUE = "PCOMP,1,-.02,3.,,,,.02\n,4,.01,30.,YES,1,.02,10.,NO\n,4,.015,-45.,,4,.01,60.\n"
GLOBAL = "PCOMPG,1,,3.,,,,.02,SYM\n,101,4,.01,30.\n,3,1,.02\n,7,4,.015,-45.\n"
CASES = {
    "thicknesses": (OBLIQUE, ["PCOMP 1 T1", "PCOMP 1 T2", "PCOMP 1 T3", "PCOMP 1 T4", "PCOMP 1 Z0"]),
    "angles": (OBLIQUE, ["PCOMP 1 THETA1", "PCOMP 1 THETA3", "PCOMP 1 T2", "PCOMP 1 THETA4"]),
    "moduli": (OBLIQUE, ["MAT8 4 E1", "MAT8 4 NU12", "MAT8 4 G1Z", "MAT1 1 E", "MAT1 1 NU", "PCOMP 1 GE"]),
    "global plies": (GLOBAL, ["PCOMPG 1 T101", "PCOMPG 1 THETA7", "PCOMPG 1 T3", "MAT8 4 G12"]),
}


def built(folder: Path, section: str) -> BuiltDeck:
    path = folder / "plate.bdf"
    path.write_text(f"{HEAD}{section}ENDDATA\n")
    return build_structure(read_deck(path))


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_matrices(name: str, tmp_path: Path):
    section, fields = CASES[name]
    model = built(tmp_path, section)
    refs = [parse_field_ref(field) for field in fields]
    for ref in refs:
        resolve(model, ref)
    names = ParameterSet(tuple(Parameter(f"p{i}") for i in range(len(refs))))
    assignments = [Assignment(f"p{i}", ref) for i, ref in enumerate(refs)]
    parametric = parametric_model(model.structure, names, assignments)
    point = configure(parametric, Configuration()).at(np.linspace(0.05, -0.1, len(refs)))
    check_matrix_derivatives(point)


@pytest.mark.slow
def test_terms_stay_few(tmp_path: Path):
    """Thirty plies make as many terms as five: those of the laws' entries."""
    counts = []
    for plies in (5, 30):
        text = "PCOMP,1\n" + "".join(f",4,.01,{15.0 * (k % 5):.1f}\n" for k in range(plies))
        model = built(tmp_path, text)
        refs = [FieldRef("PCOMP", 1, f"T{k + 1}") for k in range(2)]
        names = ParameterSet((Parameter("a"), Parameter("b")))
        made = parametric_model(model.structure, names, [Assignment("a", refs[0]), Assignment("b", refs[1])])
        counts.append(sum(term.n_columns for term in made.terms))
    assert counts[0] == counts[1]


@pytest.mark.parametrize("field", ["PCOMP 1 T9", "PCOMP 1 THETA5"])
def test_a_ply_that_is_not_there(field: str, tmp_path: Path):
    with pytest.raises(FemtuneError) as error:
        resolve(built(tmp_path, OBLIQUE), parse_field_ref(field))
    assert error.value.code == "study.unknown-field"
    assert "it has T1, THETA1" in str(error.value) or "THETA1, T1" in str(error.value)
