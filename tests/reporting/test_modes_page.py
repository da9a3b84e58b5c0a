"""The page of natural modes: made of small decks, of a study, and of made-up results."""

from __future__ import annotations

import base64
import re
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import femtune as ft
from femtune.document.document import Document, Figure, Table
from femtune.errors import FemtuneError
from femtune.reporting.html import html_text
from femtune.steps.modes import run as natural_modes
from femtune.steps.modes import shapes as record_shapes
from femtune.steps.modes.page import mode_shapes
from femtune.steps.report.build import build_page, pages
from femtune.steps.results import Results
from femtune.study.drawn_mesh import thinned

from .page_scripts import without_own_scripts

_PLATE = """SOL 103
CEND
SUBTITLE = <script>alert(1)</script>
METHOD = 1
BEGIN BULK
EIGRL   1                       {count}
PARAM,COUPMASS,1
MAT1    1       2.1+11          0.3     7850.
PSHELL  1       1       .01     1               1
GRID    1               0.0     0.0     0.0
GRID    2               1.0     0.0     0.0
GRID    3               1.0     1.0     0.0
GRID    4               0.0     1.0     0.0
GRID    5               2.0     0.5     0.0
CQUAD4  1       1       1       2       3       4
CTRIA3  2       1       2       5       3
CBAR    3       3       1       3       0.      0.      1.
PBAR    3       1       1.0-3   2.0-7   5.0-7   4.0-7
ENDDATA
"""


@pytest.fixture
def plate(tmp_path: Path) -> Path:
    """A free quadrilateral and a triangle with a bar across."""
    path = tmp_path / "plate.bdf"
    path.write_text(_PLATE.format(count=8))
    return path


def _figures(document: Document) -> list[Figure]:
    blocks = next(s for s in document.sections if s.id == "pictures").blocks
    return [b for b in blocks if isinstance(b, Figure)]


def _said(document: Document, section: str) -> str:
    return " ".join(str(getattr(b, "text", "")) for s in document.sections if s.id == section for b in s.blocks)


def _page(path: Path) -> Document:
    found = ft.modes(path)
    return build_page("modes", found.results, found.arrays)


@pytest.mark.slow
def test_a_deck_alone_gets_a_page_with_every_mode(plate: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    found = ft.modes(plate, report=page)
    text = page.read_text("utf-8")
    assert "Natural modes</p>" in text
    assert found[0].rigid_body_modes == 6
    titles = [t for f in _figures(_page(plate)) for t in re.findall(r">(\d+: [^<]*)</text>", f.svg)]
    assert [t.split(":")[0] for t in titles] == [str(i + 1) for i in range(8)]
    assert all("rigid body" in t for t in titles[:6])
    assert all(t.endswith(" Hz") for t in titles[6:])


@pytest.mark.slow
def test_the_page_loads_nothing(plate: Path, tmp_path: Path) -> None:
    ft.modes(plate, report=tmp_path / "page.html")
    text = without_own_scripts((tmp_path / "page.html").read_text("utf-8"))
    assert not re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', text)
    assert "<script" not in text
    for data in re.findall(r"data:image/svg\+xml;base64,([^\"]*)", text):
        svg = base64.b64decode(data).decode()
        assert set(re.findall(r"https?://[^\"']*", svg)) == {"http://www.w3.org/2000/svg"}
        ElementTree.fromstring(svg)


def _table(page: Document) -> Table:
    blocks = next(s for s in page.sections if s.id == "natural_modes").blocks
    return next(b for b in blocks if isinstance(b, Table))


def test_rigid_body_modes_share_a_row_and_carry_everything(plate: Path) -> None:
    """In its plane the plate is free; out of it and in rotations across it is held."""
    text = plate.read_text().replace("METHOD = 1", "METHOD = 1\nSPC = 1")
    plate.write_text(text.replace("ENDDATA", "SPC1,1,345,1,THRU,5\nENDDATA"))
    rows = [[cell.text for cell in line] for line in _table(_page(plate)).rows]
    assert rows[0][:2] == ["1 to 3", "rigid body"]
    assert rows[0][4:6] == ["100.00", "100.00"]
    assert all(line[4:6] == ["–"] * 2 for line in rows[1:3])
    assert rows[-2][:2] == ["all", "sum"]
    # quadrilateral of 1 m², triangle of 0.5 m², bar
    assert float(rows[-1][4]) == pytest.approx(7850 * (0.01 * 1.5 + 1e-3 * 2**0.5), rel=1e-4)


def test_a_free_structure_has_no_table_of_dashes(plate: Path) -> None:
    table = _table(_page(plate))
    assert [c.title for c in table.columns] == ["Mode", "Hz", "Mesh error %", "Converged mesh Hz"]
    assert [cell.text for cell in table.rows[0]] == ["1 to 6", "rigid body", "–", "–"]
    assert "its rigid-body modes have the total effective mass" in table.note


@pytest.mark.slow
def test_units_are_told_by_a_study_and_not_by_a_deck(plate: Path) -> None:
    study = plate.with_name("study.toml")
    study.write_text('[study]\ntitle = "Plate"\ndeck = "plate.bdf"\nunits = "mm-t-s"\n[modes]\ncount = 7\n')
    assert dict(_page(plate).facts)["Units"] == "those of the deck (none are declared)"
    page = _page(study)
    assert (page.title, dict(page.facts)["Units"]) == ("Plate", "mm-t-s")
    keys = html_text(page).replace("\n", " ")
    assert re.search(r"Mass</dt>\s*<dd>\S+ t\b", keys)


@pytest.mark.slow
def test_a_study_shows_its_configurations_one_by_one(plate: Path) -> None:
    study = plate.with_name("study.toml")
    study.write_text(
        '[study]\ntitle = "<b>T</b>"\ndeck = "plate.bdf"\nunits = "m-kg-s"\n[modes]\ncount = 7\n'
        '[[configuration]]\nname = "whole"\n[[configuration]]\nname = "no_tip"\nelements_off = "2"\n'
        'supports_added = ["5:123456"]\n'
    )
    found = ft.modes(study)
    results, arrays = found.results, found.arrays
    assert [m.configuration for m in results.modes] == ["whole", "no_tip"]
    faces = [arrays[m.faces_key] for m in results.mode_shapes if m.faces_key]
    assert [f.tolist() for f in faces] == [[[0, 1, 2, 3], [1, 4, 2, -1]], [[0, 1, 2, 3]]]
    assert all(f.dtype.name == "int32" for f in faces)
    text = html_text(build_page("modes", results, arrays))
    assert "<b>T</b>" not in text
    assert "&lt;b&gt;T&lt;/b&gt;" in text


def test_hostile_texts_of_results_do_nothing(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    probe = '"><script>x</script>'
    data["study"] |= {"title": probe, "deck_file": probe}
    data["model"]["notices"][0] |= {"sentence": probe, "where": probe}
    for m in data["modes"]:
        m["sturm_sentence"] = probe
    page = build_page("modes", Results.model_validate(data), arrays)
    assert "<script" not in without_own_scripts(html_text(page))
    assert all("<script" not in f.svg for f in _figures(page))


def test_results_of_before_have_no_masses_and_no_faces(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    """The made-up results of these tests have neither."""
    data["modes"] = [m for m in data["modes"] if m["stage"] == "before"]
    page = build_page("modes", Results.model_validate(data), arrays)
    assert "effective mass" not in html_text(page)
    assert _figures(page)
    assert "the model has 9000 lines" in _said(page, "pictures")


@pytest.mark.parametrize("section", sorted({t.id for t in pages()["modes"].sections} - {"provenance"}))
def test_absent_data_are_said(data: dict[str, Any], section: str) -> None:
    bare = {key: data[key] for key in ("provenance", "study")}
    document = build_page("modes", Results.model_validate(bare), {})
    assert next(s for s in document.sections if s.id == section).blocks
    text = _said(document, section)
    assert "not built" in text or "not computed" in text or section == "pictures"


def test_too_many_pictures_are_counted(plate: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mode_shapes, "MOST_PICTURES", 9)
    page = _page(plate)
    assert len(_figures(page)) == 1
    assert "5 more modes are not drawn" in _said(page, "pictures")


def test_more_modes_than_are_kept_leaves_the_first_ones(plate: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("femtune.steps.modes.shapes.MOST_MODES", 2)
    page = _page(plate)
    assert "6 more modes are not drawn" in _said(page, "pictures")


def test_huge_models_are_drawn_coarser_and_say_so(plate: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_shapes, "thinned", partial(thinned, most_faces=1))
    page = _page(plate)
    assert "The mesh is simplified in the drawing: 1 faces instead of 2" in _said(page, "pictures")
    assert len(_figures(page)) == 2


def test_solids_are_drawn_by_their_outside(tmp_path: Path) -> None:
    """Two bricks side by side: ten of their twelve faces are outside."""
    deck = tmp_path / "bricks.bdf"
    grids = [f"GRID,{1 + x + 3 * y + 6 * z},,{x}.,{y}.,{z}." for z in (0, 1) for y in (0, 1) for x in (0, 1, 2)]
    bricks = [f"CHEXA,{e},1,{e},{e + 1},{e + 4},{e + 3},{e + 6},{e + 7},\n,{e + 10},{e + 9}" for e in (1, 2)]
    rest = ["PSOLID,1,1", "MAT1,1,2.1+11,,.3,7850.", "EIGRL,1,,,8"]
    deck.write_text("\n".join(["SOL 103", "CEND", "METHOD = 1", "BEGIN BULK", *grids, *bricks, *rest, "ENDDATA", ""]))
    found = ft.modes(deck)
    results, arrays = found.results, found.arrays
    (kept,) = results.mode_shapes
    faces, points = arrays[str(kept.faces_key)], arrays[str(kept.points_key)]
    middles = points[faces].mean(axis=1)
    assert sorted(map(tuple, middles.tolist())) == sorted(
        [(0.0, 0.5, 0.5), (2.0, 0.5, 0.5)]
        + [(x, y, z) for x in (0.5, 1.5) for y, z in ((0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0))]
    )
    assert len(_figures(build_page("modes", results, arrays))) == 2


def test_models_without_extent_say_so(tmp_path: Path) -> None:
    deck = tmp_path / "scalar.bdf"
    deck.write_text("SOL 103\nCEND\nBEGIN BULK\nSPOINT,1\nCELAS2,1,9.,1\nCMASS2,3,1.,1\nENDDATA\n")
    page = _page(deck)
    assert "no shells, no solids and no two-node or rigid elements to draw" in _said(page, "pictures")
    assert ">nan<" not in html_text(page).lower()


@pytest.mark.parametrize(
    ("name", "words"), [("", "Is a directory"), ("none/page.html", "No such file"), ("a\0b", "null")]
)
def test_a_page_that_cannot_be_written_is_refused_first(
    plate: Path, tmp_path: Path, name: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(natural_modes, "solved_cases", lambda *_, **__: pytest.fail("it was solved"))
    with pytest.raises(FemtuneError, match=words) as caught:
        ft.modes(plate, report=tmp_path / name)
    assert caught.value.code == "run.unwritable"
    assert [f.name for f in tmp_path.iterdir()] == ["plate.bdf"]


def test_a_failure_leaves_no_empty_page(plate: Path, tmp_path: Path) -> None:
    plate.write_text(plate.read_text().replace("PSHELL  1 ", "PSHELL  7 "))
    with pytest.raises(FemtuneError):
        ft.modes(plate, report=tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


@pytest.mark.slow
def test_only_a_page_is_replaced_by_a_page(plate: Path, tmp_path: Path) -> None:
    deck, page = plate.read_bytes(), tmp_path / "page.html"
    with pytest.raises(FemtuneError, match="is not a page that femtune wrote") as caught:
        ft.modes(plate, report=plate)
    assert caught.value.code == "run.unwritable"
    assert plate.read_bytes() == deck
    for _ in range(2):
        assert ft.modes(plate, report=page).report == page
