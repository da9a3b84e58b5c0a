"""The case of the subframe: its study is valid, and its channels are spread."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from cases.subframe.studies import Compared, Effort, equalised, held_out
from femtune.files.study_file import study_from_text
from structures.subframe_campaign import FREE, Laboratory, Measured

TEST = Compared(FREE, Measured((60.0, 450.0)), (100.0, 395.0))


def test_eighteen_channels_are_held_out_over_the_whole_structure() -> None:
    outputs = Laboratory(5_000).outputs
    held = held_out(outputs)
    assert len(set(held)) == 18
    places = [outputs.index(name) for name in held]
    assert max(b - a for a, b in pairwise(places)) <= 4


def test_the_study_is_valid(tmp_path: Path) -> None:
    lab = Laboratory(5_000)
    path = tmp_path / "study.toml"
    for name in ("subframe.bdf", "free.uff"):
        (tmp_path / name).touch()
    first = study_from_text(equalised(lab, TEST, Effort(30, 2.0, 3, 9)), path)
    assert first.equalise is not None
    assert (first.equalise.band_hz, first.update.starts) == ((60.0, 450.0), 3)
    assert [p.name for p in first.parameter] == list(lab.names)
    (compared,), (held,) = first.residual, first.hold_out
    assert set(compared.outputs) | set(held.outputs) == set(lab.outputs)
    assert not set(compared.outputs) & set(held.outputs)
