"""What merging coincident grid points would do: the frequencies are those of the deck whose points are merged."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tests.files.nastran.plates import PLATE, SECOND
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import Notice


def _deck(folder: Path, name: str, bulk: str) -> Path:
    (folder / name).write_text(bulk + "EIGRL,1,,,8\nENDDATA\n")
    return folder / name


@pytest.mark.slow
def test_the_frequencies_are_those_of_the_merged_deck(tmp_path: Path) -> None:
    merged = re.sub(r"^GRID,10[1-5],.*\n", "", SECOND, flags=re.MULTILINE)
    merged = re.sub(r"(?<=,)10([1-5])\b(?!,1,)", lambda m: str(20 + int(m[1])), merged)
    wanted = ft.modes(_deck(tmp_path, "merged.bdf", PLATE + merged)).frequencies
    found = ft.info(_deck(tmp_path, "open.bdf", PLATE + SECOND))
    (alert,) = [a for a in found.notices if a.code == "model.merged-points"]
    first = ", ".join(f"{row['freq_hz']:.4g}" for row in list(wanted)[:3])
    assert f"would be {first} Hz instead of" in alert.sentence
    assert "above 6 rigid-body modes" in alert.sentence
    assert "5 pairs" in alert.sentence


def test_a_sound_deck_is_not_merged(tmp_path: Path) -> None:
    found = ft.info(_deck(tmp_path, "plate.bdf", PLATE))
    assert not [a for a in found.notices if a.code == "model.merged-points"]


def test_page_shows_the_remark() -> None:
    check_shown(
        "model.merged-points",
        Notice(
            "model.merged-points",
            configuration="baseline",
            count=6,
            after="2.534, 10.32, 15.6 Hz",
            before="10.12, 23.68, 36.79 Hz above 6 rigid-body modes",
        ),
    )


@pytest.mark.parametrize("link", ["RBE2,{e},{a},123456,{b}\n"])
def test_points_that_are_connected_are_not_merged(tmp_path: Path, link: str) -> None:
    links = "".join(link.format(e=900 + j, a=21 + j, b=101 + j) for j in range(5))
    found = ft.info(_deck(tmp_path, "linked.bdf", PLATE + SECOND + links))
    assert not [a for a in found.notices if a.code == "model.merged-points"]
