"""A deck of shaped and tapered beams: matrices and modes by dimensions of both ends, through what follows from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.model import Assignment, Configuration, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from femtune.testing import check_model

DECK = """SOL 103
CEND
BEGIN BULK
PARAM,COUPMASS,1
MAT1,1,2.1+11,8.1+10,,7850.
MAT1,2,.7+11,2.6+10,,2700.
GRID,1,,0.,0.,0.,,123456
GRID,2,,1.,.1,0.
GRID,3,,1.7,.5,.6
GRID,4,,1.9,.9,1.4
CBEAM,1,3,1,2,0.,0.,1.
CBEAM,2,4,2,3,0.,0.,1.
CBEAM,3,5,3,4,0.,1.,0.
PBEAML,3,1,,I
,.2,.1,.14,.008,.012,.01,.5,YES
,1.,.2,.1,.12,.007,.012,.01,.5
PBEAM,4,1,1.-3,2.-6,3.-6,1.-7,4.-6,.5
,NO,1.,5.-4,1.-6,,,2.-6
,.8,.7,,,1.-3
,.01,.02,,,.03,,.04
PBCOMP,5,1,1.-3,,,,4.-6,.5
,1.,1.,,,,,2
,.1,.05,.3
,-.1,.02,.2,2
ENDDATA
"""
FIELDS = ("PBEAML 3 DIM1", "PBEAML 3 DIM3B", "PBEAM 4 AB", "PBEAM 4 N1A", "PBCOMP 5 A", "MAT1 2 E")


@pytest.mark.quick(0, gate=1)
@pytest.mark.parametrize("fields", [FIELDS[:3], FIELDS[3:]])
def test_matrices_and_modes(tmp_path: Path, fields: tuple[str, ...]):
    path = tmp_path / "deck.bdf"
    path.write_text(DECK)
    built = build_structure(read_deck(path))
    refs = [parse_field_ref(field) for field in fields]
    for ref in refs:
        resolve(built, ref)
    names = ParameterSet(tuple(Parameter(f"p{i}") for i in range(len(refs))))
    assignments = [Assignment(f"p{i}", ref) for i, ref in enumerate(refs)]
    model = configure(parametric_model(built.structure, names, assignments), Configuration())
    check_model(model.at(np.array([0.05, -0.1, 0.1])), [0, 1, 2])
