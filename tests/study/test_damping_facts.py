"""What info says of the damping in a deck, and updates of damping by a study."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from femtune import info
from femtune.document.document import Paragraph, Table
from femtune.steps.info.terminal import damping_blocks
from femtune.study.study import load_study

DECK = """SOL 111
CEND
SDAMPING = 7
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,2.,0.,0.
MAT1,1,2.+11,,.3,7800.,,,.02
MAT1,2,2.+11,,.3,7800.,,,.05
CONROD,1,1,2,1,.1,.1
CONROD,2,2,3,2,.1,.1
CONROD,3,1,3,2,.1,.1
PBUSH,4,K,1.+5,1.+5,1.+5,1.+5,1.+5,1.+5
,,B,1.,,2.
,,GE,.1
CBUSH,4,4,1,,,,,0
CBUSH,5,4,2,,,,,0
CDAMP2,6,3.,2,1
PARAM,G,0.
PARAM,W3,100.
TABDMP1,7,CRIT
,1.,.01,100.,.02,ENDT
ENDDATA
"""


def _deck(folder: Path, text: str = DECK) -> Path:
    path = folder / "deck.bdf"
    path.write_text(text)
    return path


def test_damping_by_card_and_field(tmp_path: Path) -> None:
    facts = info(_deck(tmp_path)).record
    assert facts.damping is not None
    found = {f.field: (f.kind, f.cards, f.lowest, f.highest, f.elements) for f in facts.damping.fields}
    assert found == {
        "MAT1 GE": ("loss factor", 2, 0.02, 0.05, 3),
        "PBUSH GE": ("loss factor", 1, 0.1, 0.1, 2),
        "PBUSH B": ("viscous", 1, 1.0, 2.0, 2),
        "CDAMP2 B": ("viscous", 1, 3.0, 3.0, 1),
    }
    assert (facts.damping.overall_loss_factor, facts.damping.overall_omega_rad_s) == (0.0, 100.0)
    assert facts.damping.element_omega_rad_s is None
    assert facts.damping.modal_damping == "table 7: damping ratios 0.01 to 0.02 from 1 to 100 Hz, as viscous damping"


def test_damping_in_words(tmp_path: Path) -> None:
    overall, modal, table = damping_blocks(info(_deck(tmp_path)).record)
    assert isinstance(overall, Paragraph)
    assert overall.text == "Damping of the whole model: G = 0, W3 = 100 rad/s."
    assert isinstance(modal, Paragraph)
    assert modal.text.startswith("Damping of modes (SDAMPING), table 7")
    assert isinstance(table, Table)
    assert [cell.text for cell in table.rows[0]][-2:] == ["0.02 to 0.05", "3"]


def test_a_deck_without_damping(tmp_path: Path) -> None:
    plain = "GRID,1,,0.,0.,0.\nMAT1,1,2.+11,,.3,7800.\nCELAS2,1,3.,1,1\nCONM2,2,1,,4.\n"
    (block,) = damping_blocks(info(_deck(tmp_path, plain)).record)
    assert isinstance(block, Paragraph)
    assert "none" in block.text


STUDY = """
[study]
title = "damping"
deck = "deck.bdf"
units = "m-kg-s"

[[parameter]]
name = "overall"
fields = ["PARAM G"]
absolute = true
lower = 0.0
upper = 0.1

[[parameter]]
name = "materials"
fields = ["MAT1 GE"]
lower = 0.5
upper = 2.0

[[parameter]]
name = "bush"
fields = ["PBUSH 4 GE1"]
absolute = true
lower = 0.0
upper = 0.5
"""


def test_a_study_may_move_every_loss_factor(tmp_path: Path) -> None:
    _deck(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY)
    study = load_study(tmp_path / "study.toml")
    x = study.parameters.normalise([0.03, 1.5, 0.2])
    values = {str(ref): value for ref, value in study.model.field_values(x).items()}
    assert np.allclose(values["PARAM G"], 0.03)
    assert np.allclose([values["MAT1 1 GE"], values["MAT1 2 GE"], values["PBUSH 4 GE1"]], [0.03, 0.075, 0.2])
    point = study.cases[0].configured.at(x)
    diagonal = point.hysteretic.toarray().diagonal() / point.stiffness.toarray().diagonal()
    # rotation about y of the first point is held by the bush only: its loss factor and the overall one
    at = [str(study.cases[0].configured.free_dof(i)) for i in range(point.configured.n_free)].index("1RY+")
    assert np.isclose(diagonal[at], 0.23)
