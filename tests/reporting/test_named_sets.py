"""Sets of degrees of freedom that the deck names stand in `femtune info` and in the report, with their counts."""

from __future__ import annotations

from pathlib import Path

from femtune import info
from femtune.document.document import Table
from femtune.steps.info.page import named_sets

_DECK = (
    "SOL 103\nCEND\nSPC=1\nBEGIN BULK\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nCELAS2,9,1.+3,1,1,2,1\nCMASS2,8,2.,2,1\n"
    "SPC1,1,123456,1\nSPC1,1,23456,2\nSUPORT,2,1\nASET1,12,1,2\nENDDATA\n"
)


def test_names_counts_and_effects(tmp_path: Path) -> None:
    (tmp_path / "deck.bdf").write_text(_DECK)
    facts = info(tmp_path / "deck.bdf").record
    assert {s.name: s.dofs for s in facts.dof_sets} == {"SUPORT": 1, "ASET": 4}
    (table,) = named_sets(facts)
    assert isinstance(table, Table)
    assert "not constrained" in str(table)
    assert named_sets(facts.model_copy(update={"dof_sets": ()})) == []
