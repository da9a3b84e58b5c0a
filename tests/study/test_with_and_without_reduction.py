"""The same study with and without an empty ``[reduction]``: parameters, fit, and what the judge finds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from structures.wrong_property import FRAME


@pytest.mark.slow
def test_reduced_and_full_models_are_judged_alike(tmp_path: Path) -> None:
    study = FRAME.study(tmp_path, {"PBAR 1 I2": 1.2, "PBAR 3 I2": 0.85, "PBAR 4 I2": 1.1})
    full = ft.validate(study, output=tmp_path / "full").results
    reduced = ft.validate(study, output=tmp_path / "reduced", reduction={}).results
    assert full.update is not None
    assert reduced.update is not None
    assert reduced.update.reduction is not None
    assert reduced.update.reduction.certified
    for one, other in zip(full.update.parameters, reduced.update.parameters, strict=True):
        assert one.sd is not None
        assert abs(one.value - other.value) < 0.02 * one.sd
    assert full.judgement is not None
    assert reduced.judgement is not None
    assert reduced.judgement.verdict == full.judgement.verdict
    assert [r.code for r in reduced.judgement.reasons] == [r.code for r in full.judgement.reasons]
    # χ² along the principal axes is that of the reduced models, which agree with the full one
    ours, theirs = full.judgement.linearity, reduced.judgement.linearity
    assert ours is not None
    assert theirs is not None
    assert len(ours.points) == len(theirs.points) == 6
    np.testing.assert_allclose([p.true for p in theirs.points], [p.true for p in ours.points], rtol=0.02)
