"""The case of the subframe: its study is valid, its channels are spread, and its tests end between modes."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from cases.subframe.studies import Effort, family
from femtune.files.study_file import study_from_text
from femtune.model import solve_modes
from structures.subframe_campaign import FREE, Laboratory, Measured
from structures.subframe_study import Compared, held_out

TEST = Compared(FREE, Measured((60.0, 450.0), 2.0), (100.0, 350.0), (360.0, 450.0))


@pytest.mark.slow
def test_eighteen_channels_are_held_out_over_the_whole_structure() -> None:
    outputs = Laboratory(5_000).outputs
    held = held_out(outputs)
    assert len(set(held)) == 18
    places = [outputs.index(name) for name in held]
    assert max(b - a for a, b in pairwise(places)) <= 4


@pytest.mark.slow
def test_the_study_is_valid(tmp_path: Path) -> None:
    lab = Laboratory(5_000, common=("E_sides", "E_crosses"))
    path = tmp_path / "study.toml"
    for name in ("subframe.bdf", "ID1.uff", "ID2.uff", "ID3.uff"):
        (tmp_path / name).touch()
    first = study_from_text(family(lab, TEST, Effort(30, 2.0, 3, 9, 100)), path)
    assert first.equalise is not None
    assert first.bootstrap is not None
    assert (first.update.starts, first.bootstrap.runs) == (3, 100)
    assert first.specimens == ("ID1", "ID2", "ID3")
    assert [p.name for p in first.parameter if not p.individual] == ["E_sides", "E_crosses"]
    (compared,), (held,) = first.residual, first.hold_out
    assert set(compared.outputs) | set(held.outputs) == set(lab.outputs)
    assert not set(compared.outputs) & set(held.outputs)


def test_components_have_the_common_parameters_of_the_first() -> None:
    lab = Laboratory(5_000, common=("E_sides",))
    truths = np.array([lab.truth(i) for i in range(3)])
    np.testing.assert_array_equal(truths[0], Laboratory(5_000).truth(0))
    assert np.ptp(truths[:, 0]) == 0.0
    assert (np.ptp(truths[:, 1:], axis=0) > 0.0).all()


@pytest.mark.slow
def test_the_lines_of_a_test_end_away_from_modes() -> None:
    lab = Laboratory(5_000)
    end = TEST.test(lab, 0).freq_hz[-1]
    hertz = solve_modes(lab.configured[FREE.name].at(lab.truth(0)), None, 500.0).freq_hz
    assert TEST.end_hz is not None
    assert TEST.end_hz[0] <= end <= TEST.end_hz[1]
    assert np.abs(hertz / end - 1.0).min() > 0.03
