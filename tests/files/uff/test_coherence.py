"""Coherence of measured FRFs in Universal Files, as other programs write it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.described_test import read_described
from femtune.steps.identify.request import asked_of

from .coherences import content_of


def test_coherence_belongs_to_its_function(tmp_path: Path) -> None:
    first, second = np.linspace(0.5, 1.0, 20), np.full(20, 0.9)
    # the sign of a direction does not matter for a coherence
    content = content_of(tmp_path, {(1, 1): first, (2, 1): second})
    frfs = content.test.frfs
    assert frfs is not None
    assert frfs.coherence is not None
    np.testing.assert_allclose(frfs.coherence[:, 0], [first, second], rtol=1e-6)
    assert not [n for n in content.notices if n.code == "uff.not-an-frf"]


def test_functions_without_coherence_have_none(tmp_path: Path) -> None:
    content = content_of(tmp_path, {(2, -1): np.full(20, 0.8)})
    frfs = content.test.frfs
    assert frfs is not None
    assert frfs.coherence is not None
    assert np.isnan(frfs.coherence[0]).all()
    np.testing.assert_allclose(frfs.coherence[1, 0], 0.8, rtol=1e-6)
    plain = content_of(tmp_path, {}).test.frfs
    assert plain is not None
    assert plain.coherence is None


@pytest.mark.parametrize("value", [-0.1, 1.2])
def test_what_is_no_coherence_is_not_used(tmp_path: Path, value: float) -> None:
    content = content_of(tmp_path, {(1, 1): np.full(20, value)})
    assert content.test.frfs is not None
    assert content.test.frfs.coherence is None
    (notice,) = [n for n in content.notices if n.code == "uff.not-an-frf"]
    assert "of function type 6" in notice.what


def test_a_rounding_above_one_is_one(tmp_path: Path) -> None:
    frfs = content_of(tmp_path, {(1, 1): np.full(20, 1.0 + 1e-5)}).test.frfs
    assert frfs is not None
    assert frfs.coherence is not None
    assert frfs.coherence[0].max() == 1.0


@pytest.mark.parametrize("by_type", [True, False])
def test_transmissibilities_are_refused_by_name(tmp_path: Path, by_type: bool) -> None:
    """By function type 5, or as motion over motion: the data type of the force, 13, is that of an acceleration, 12."""
    content_of(tmp_path, {})
    lines = (tmp_path / "a.uff").read_text().split("\n")
    starts = [i for i, line in enumerate(lines) if line.strip() == "58"]
    for i in starts:
        at, old, new = (i + 6, "    4", "    5") if by_type else (i + 10, "        13", "        12")
        assert lines[at].startswith(old), lines[at]
        lines[at] = new + lines[at][len(old) :]
    (tmp_path / "t.uff").write_text("\n".join(lines))
    with pytest.raises(FemtuneError) as caught:
        read_described(asked_of(tmp_path / "t.uff", {"units": "m-kg-s"}))
    assert caught.value.code == "identify.no-frfs"
    assert any("transmissibilit" in notice.what for notice in caught.value.notices)
