"""Frequencies without shapes beside a deck: init, check, correlate and run, and what they cost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.testing import example_deck

DECK_HZ = (28.268, 44.695, 201.10, 317.97, 586.94, 928.04)
"""Frequencies of the example."""
STUDY = """
[study]
title = "Cantilever"
deck = "cantilever.bdf"
units = "m-kg-s"

[test]
{test}

[[parameter]]
name = "E"
fields = ["MAT1 1 E"]
lower = 0.7
upper = 1.4

[residuals]
frequency_sd = 0.005
"""


def _study(folder: Path, test: str) -> Path:
    example_deck(folder)
    path = folder / "study.toml"
    path.write_text(STUDY.format(test=test), encoding="utf-8")
    return path


def _listed(*modes: int) -> str:
    return f"freq_hz = [{', '.join(f'{0.97 * DECK_HZ[i - 1]:.3f}' for i in modes)}]"


def _codes(result: Any) -> list[str]:
    return [a.code for c in result.records for a in c.alerts]


@pytest.mark.slow
def test_init_writes_a_study_that_is_right_for_check(tmp_path: Path) -> None:
    deck = example_deck(tmp_path)
    table = tmp_path / "list.csv"
    table.write_text("mode,freq_hz,freq_sd_hz\nA,27.4,.05\nB,43.4,.1\nC,195.1,.3\nD,308.5,.5\n")
    made = ft.init(deck, table, tmp_path / "made", units="m-kg-s")
    assert made.record.paired == 4
    assert "no MAC without shapes" in made.record.agreement
    text = made.path.read_text(encoding="utf-8")
    assert 'frequency_sd = "test"' in text
    assert "shape_sd" not in text
    assert not ft.check(made.path).errors


def test_correlate_pairs_in_order_with_a_reservation(tmp_path: Path) -> None:
    result = ft.correlate(_study(tmp_path, _listed(1, 2, 3, 4)))
    (found,) = result.records
    assert [(p.test_label, p.model_number, p.mac) for p in found.pairs] == [(str(i), i, None) for i in range(1, 5)]
    assert _codes(result) == ["correlate.without-shapes"]
    with pytest.raises(FemtuneError, match=r"\[correlate.no-shapes\]"):
        _ = result.mac


def test_a_list_that_misses_a_mode_is_not_accepted_and_a_pair_mends_it(tmp_path: Path) -> None:
    missed = _study(tmp_path, _listed(1, 3, 4, 5, 6))
    found = ft.correlate(missed)
    assert "correlate.order-doubtful" in _codes(found)
    mended = _study(tmp_path, _listed(1, 3, 4, 5, 6) + '\npairs = [{ test = "2", model = 3 }]')
    result = ft.correlate(mended)
    assert [p.model_number for p in result.records[0].pairs] == [1, 3, 4, 5, 6]
    assert _codes(result) == ["correlate.without-shapes"]


@pytest.mark.slow
def test_run_updates_to_the_frequencies_and_tells_what_is_open(tmp_path: Path) -> None:
    result = ft.run(_study(tmp_path, _listed(1, 2, 3, 4)))
    judged = result.results.judgement
    assert judged is not None
    codes = {r.code: r.weight for r in judged.reasons}
    assert codes["correlate.without-shapes"] == "reservation"
    assert "correlate.order-doubtful" not in codes
    (value,) = result.values.values()
    assert value == pytest.approx(0.97**2, rel=1e-4)
    assert (tmp_path / "run" / "report.html").is_file()


def test_deviations_need_one_for_each_frequency(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError, match=r"\[study.test-source\] freq_sd_hz"):
        ft.info(_study(tmp_path, "freq_hz = [1.0, 2.0]\nfreq_sd_hz = [0.1]"))
