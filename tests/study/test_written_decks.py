"""The updated deck of a study: INCLUDEs, regions, cards shared by several parameters, and inputs that stay whole."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import femtune as ft
import femtune.steps.write.run as written_decks
from femtune.document.document import Cell
from femtune.errors import FemtuneError
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.steps.report_source import ReportSource
from femtune.steps.run.alerts import alerts_of
from femtune.steps.run.result import RunResult
from femtune.steps.update.facts.update import parameter_facts
from femtune.steps.write.page import write_back
from femtune.study.study import load_study

from .cantilever import Bench, bounded

SHARED = "\n" + bounded("clamp", "PBAR 1 I1", "elements = [1]\n")
STIFF_CLAMP = (
    ("CBAR    1       1  ", "CBAR    1       3  "),
    ("PBAR    2 ", "PBAR    3       1       1.0-3   2.8-7   5.0-7   4.0-7\nPBAR    2 "),
)


def frequencies(run: RunResult, stage: str) -> tuple[float, ...]:
    return next(m.freq_hz for m in run.results.modes if m.stage == stage)


def values(run: RunResult) -> dict[str, float]:
    assert run.results.update is not None
    return {p.name: p.value for p in run.results.update.parameters}


def codes(run: RunResult) -> list[str]:
    """Without those about the mass and the few bars of the mesh."""
    return [a.code for a in run.results.alerts if a.code not in ("model.lumped-mass", "model.mesh-coarse")]


def role(deck: Path, element: int, name: str) -> float:
    structure = build_structure(read_deck(deck)).structure
    batch = next(b for b in structure.batches if element in b.ids)
    return float(structure.values.values[batch.roles[name][batch.ids.tolist().index(element)]])


@pytest.fixture
def clamp(bench: Bench) -> Bench:
    """A real beam that is stiffer at its clamp, where the deck has one property for two elements."""
    bench.uff(bench.measure(bench.truth(STIFF_CLAMP)))
    return bench


@pytest.mark.slow
@pytest.mark.parametrize("rest", ["", SHARED.replace("clamp", "rest").replace("elements = [1]", "elements = [2]")])
def test_a_shared_card_that_must_not_be_split_is_refused_before_the_update(clamp: Bench, rest: str) -> None:
    study = clamp.study(SHARED + rest + "[write]\nsplit = false\n")
    assert [e.code for e in ft.check(study).errors] == ["write.shared"]
    with pytest.raises(FemtuneError) as caught:
        ft.update(study)
    assert caught.value.code == "write.shared"
    assert "PBAR 1 I1" in caught.value.what
    assert not (clamp.folder / "run" / "history.jsonl").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "entry"),
    [
        ("write.no-card", 'name = "joint"\nfields = ["STIFFNESS"]\nelements = [1]\nlower = 0.5\nupper = 2.0\n'),
        ("write.replicated", ""),
    ],
)
def test_what_cannot_be_written_is_found_by_the_check(beam: Bench, code: str, entry: str) -> None:
    if not entry:
        lines = beam.text.splitlines(keepends=True)
        at = next(i for i, line in enumerate(lines) if line.startswith("PBAR    2"))
        lines[at - 1 : at + 1] = ["PBAR,1,1,1.0-3,2.0-7,5.0-7,4.0-7\n", "=,*(1),==\n"]
        beam.write("beam.bdf", "".join(lines))
    study = beam.study("[[parameter]]\n" + entry) if entry else beam.study()
    assert {e.code for e in ft.check(study).errors} == {code}
    without = beam.study(("[[parameter]]\n" + entry if entry else beam.parameters) + "\n[write]\ndeck = false\n")
    assert ft.check(without).errors == ()


@pytest.mark.slow
def test_without_a_deck_the_result_is_the_table_of_parameters(clamp: Bench) -> None:
    run = ft.update(clamp.study(SHARED.replace("PBAR 1 I1", "STIFFNESS") + "[write]\ndeck = false\n"))
    assert not list(run.folder.glob("*.bdf"))
    assert "write.no-deck" in codes(run)
    assert run.results.write_back is None
    assert {m.stage for m in run.results.modes} == {"before", "after"}


SOME_OF_A_MATERIAL = bounded("clamp", "MAT1 1 E", "elements = [1]\n") + bounded("tip", "PBAR 2 I1")


@pytest.mark.slow
@pytest.mark.parametrize("study", [SHARED, SOME_OF_A_MATERIAL], ids=["property", "material and property"])
def test_the_written_deck_is_the_solution(clamp: Bench, study: str) -> None:
    """Also where a region of a shared card and a whole card change together."""
    run = ft.update(clamp.study(study))
    update = run.results.update
    assert update is not None
    assert update.objective_as_written_percent is not None
    assert update.objective_as_written_percent == pytest.approx(update.objective_after_percent, abs=0.01)
    assert frequencies(run, "after as written") == pytest.approx(frequencies(run, "after"), rel=1e-3)
    assert run.results.write_back is not None
    assert run.results.write_back.differences == ()
    assert not (run.folder / "unverified.bdf").exists()


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["value", "frequency"])
def test_a_deck_that_is_not_the_update_gets_no_name(clamp: Bench, fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A planted error of the writer: a changed field that is dropped, or a mass that comes in."""
    study = clamp.study(SHARED)
    first = ft.update(study)
    assert (first.folder / "updated.bdf").exists()
    original = written_decks.write_deck

    def faulty(*arguments: Any, **options: Any) -> Any:
        written = original(*arguments, **options)
        text = written.main.read_text()
        if fault == "value":
            text = "".join(x for x in text.splitlines(keepends=True) if not x.startswith("PBAR    3"))
            text = text.replace("CBAR    1       3", "CBAR    1       1")
        else:
            text = text.replace("ENDDATA", "CONM2,9001,3,,1.0\nENDDATA")
        written.main.write_text(text)
        return written

    monkeypatch.setattr(written_decks, "write_deck", faulty)
    if fault == "frequency":
        # its elements differ, which is found before frequencies are compared
        monkeypatch.setattr("femtune.steps.write.in_run.check_written", lambda built, study: None)
    with pytest.raises(FemtuneError) as caught:
        ft.update(study)
    assert caught.value.code == "write.differs"
    assert ("PBAR 1 I1" in caught.value.what) == (fault == "value")
    assert " Hz instead of " in caught.value.what
    assert not (first.folder / "updated.bdf").exists()
    assert (first.folder / "unverified.bdf").exists()
    results = ft.read_results(first.folder).results
    assert results.write_back is not None
    assert results.write_back.files == ("unverified.bdf",)
    assert results.write_back.differences
    assert results.alerts[0].code == "write.differs"


@pytest.mark.slow
def test_rounding_that_matters_is_an_alert(beam: Bench) -> None:
    study = beam.study()
    results = ft.update(study).results
    assert results.update is not None
    worse = results.update.model_copy(update={"objective_as_written_percent": 1.0})
    found = alerts_of(load_study(study), results.model_copy(update={"update": worse}))
    assert [(a.level, a.code) for a in found if a.code.startswith("write.")] == [("warning", "write.rounding")]
    assert "1 %" in found[0].sentence


@pytest.mark.slow
def test_split_gives_the_region_a_card_of_its_own(clamp: Bench) -> None:
    run = ft.update(clamp.study(SHARED))
    deck = run.folder / "updated.bdf"
    assert role(deck, 1, "I1") == pytest.approx(2.8e-7, rel=1e-3)
    assert role(deck, 2, "I1") == 2e-7
    assert codes(run) == ["uff.not-measured"]
    assert run.results.write_back is not None
    assert run.results.write_back.splits == ("PBAR 1 was copied to PBAR 3 for the 1 elements of clamp",)
    assert frequencies(run, "after as written") == pytest.approx(frequencies(run, "after"), rel=1e-4)
    assert frequencies(run, "after as written") == pytest.approx(clamp.modes(deck), rel=1e-9)
    assert run.results.update is not None
    assert run.results.update.parameters[0].written[0].value == role(deck, 1, "I1")


@pytest.mark.slow
def test_new_cards_and_the_elements_on_them_are_recorded(clamp: Bench) -> None:
    run = ft.update(clamp.study(SHARED))
    found = run.results.write_back
    assert found is not None
    assert found.edits == ()
    (card,) = found.new_cards
    assert (card.card, card.copied_from, card.region, card.elements) == ("PBAR 3", "PBAR 1", "clamp", 1)
    (value,) = card.values
    assert (value.field, value.old_text, value.parameter) == ("I1", "2.0-7", "clamp")
    assert value.value == pytest.approx(2e-7 * values(run)["clamp"], rel=1e-12)
    assert value.rounded_value == role(run.folder / "updated.bdf", 1, "I1")
    (moved,) = found.repointed
    assert (moved.card, moved.field, moved.before, moved.after, moved.elements) == ("CBAR", "PID", "1", "PBAR 3", (1,))
    page = " ".join(c.text for b in write_back(ReportSource(run.results, run.arrays)) for c in cells(b))
    assert "1 CBAR now refers to PBAR 3" in page
    assert "PBAR 3 PBAR 1 1 I1 2.0-7" in page


@pytest.mark.slow
def test_a_copied_material_names_its_new_property(clamp: Bench) -> None:
    text = SHARED.replace("PBAR 1 I1", "MAT1 1 E")
    run = ft.update(clamp.study(text))
    found = run.results.write_back
    assert found is not None
    by_card = {c.card.split()[0]: c for c in found.new_cards}
    assert by_card["MAT1"].values[0].rounded_value == role(run.folder / "updated.bdf", 1, "E")
    assert [(v.field, v.old_text) for v in by_card["PBAR"].values] == [("material", "1")]
    assert by_card["PBAR"].values[0].value == int(by_card["MAT1"].card.split()[1])


def test_elements_of_a_region_that_do_not_use_the_field_are_not_counted(clamp: Bench) -> None:
    study = load_study(clamp.study(SHARED.replace("elements = [1]", "elements = [1, 3, 4]")))
    assert [p.elements for p in parameter_facts(study)] == [1]


def cells(block: object) -> list[Cell]:
    return [cell for found in getattr(block, "rows", ()) for cell in found]


TWO_ON_ONE_REGION = """
[write]
wide = true
[[parameter]]
name = "clamp"
fields = ["PBAR 1 I1"]
elements = [1]
lower = 0.5
upper = 2.0
[[parameter]]
name = "side"
fields = ["PBAR 1 I2"]
elements = {side}
lower = 0.5
upper = 2.0
"""


@pytest.mark.slow
@pytest.mark.parametrize("side", ["[1]", "[1, 2]", "[2]"])
def test_two_parameters_on_one_card_each_with_a_region(clamp: Bench, side: str) -> None:
    run = ft.update(clamp.study(TWO_ON_ONE_REGION.format(side=side)))
    assert frequencies(run, "after as written") == pytest.approx(frequencies(run, "after"), rel=1e-9)
    deck, found = run.folder / "updated.bdf", values(run)
    assert role(deck, 1, "I1") == pytest.approx(2e-7 * found["clamp"], rel=1e-9)
    for element in (1, 2):
        expected = 5e-7 * (found["side"] if str(element) in side else 1.0)
        assert role(deck, element, "I2") == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_a_region_and_all_others_of_one_card(clamp: Bench) -> None:
    rest = bounded("rest", "PBAR 1 I2")
    run = ft.update(clamp.study(SHARED + rest + "[write]\nwide = true\n"))
    assert frequencies(run, "after as written") == pytest.approx(frequencies(run, "after"), rel=1e-7)


@pytest.mark.slow
def test_material_of_a_region_with_derived_shear_modulus(clamp: Bench) -> None:
    text = SHARED.replace("PBAR 1 I1", "MAT1 1 E") + "[write]\nwide = true\n"
    run = ft.update(clamp.study(text))
    deck = run.folder / "updated.bdf"
    assert frequencies(run, "after as written") == pytest.approx(frequencies(run, "after"), rel=1e-9)
    assert role(deck, 1, "G") == pytest.approx(role(deck, 1, "E") / 2.6)
    assert role(deck, 2, "E") == 2.1e11


@pytest.fixture
def parts(beam: Bench) -> Bench:
    """The deck in three files: properties in a folder of their own, coordinates beside."""
    lines = beam.text.splitlines()
    for name, cards in (("parts/props.inc", ("PBAR", "MAT1")), ("grids.inc", ("GRID",))):
        beam.write(name, "\n".join(line for line in lines if line.startswith(cards)) + "\n")
    kept = [line for line in lines if not line.startswith(("PBAR", "MAT1", "GRID"))]
    at = kept.index("BEGIN BULK") + 1
    beam.write("beam.bdf", "\n".join([*kept[:at], "INCLUDE 'parts/props.inc'", "INCLUDE 'grids.inc'", *kept[at:], ""]))
    return beam


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["run", "far/away from here", "../elsewhere", "."])
def test_includes_are_kept(parts: Bench, folder: str) -> None:
    inputs = {p: p.read_bytes() for p in parts.folder.rglob("*") if p.is_file()}
    run = ft.update(parts.study(), output=parts.folder / folder)
    assert {p: p.read_bytes() for p in inputs} == inputs
    assert run.results.write_back is not None
    assert run.results.write_back.files == ("updated.bdf", "props.inc")
    assert "INCLUDE 'props.inc'" in (run.folder / "updated.bdf").read_text()
    read = {Path(f.file).resolve() for f in read_deck(run.folder / "updated.bdf").files}
    assert (parts.folder / "grids.inc").resolve() in read
    assert (parts.folder / "parts/props.inc").resolve() not in read
    assert frequencies(run, "after as written") == pytest.approx(parts.modes(run.folder / "updated.bdf"), rel=1e-9)
    edit = run.results.write_back.edits[0]
    assert edit.file == "parts/props.inc"
    assert (parts.folder / edit.file).read_text().splitlines()[edit.line - 1].startswith("PBAR    1")


@pytest.mark.slow
def test_a_changed_include_replaces_no_file_of_a_user_in_the_run_folder(parts: Bench) -> None:
    (parts.folder / "run").mkdir()
    mine = parts.folder / "run" / "props.inc"
    mine.write_text("$ mine\n")
    for _ in range(2):
        run = ft.update(parts.study())
        assert run.results.write_back is not None
        main, copy = run.results.write_back.files
        assert copy != "props.inc"
        assert f"INCLUDE '{copy}'" in (run.folder / main).read_text()
        # the copy of the first run is replaced by that of the second
        assert sorted(p.name for p in run.folder.glob("*.inc")) == sorted(["props.inc", copy])
    assert mine.read_text() == "$ mine\n"


@pytest.mark.slow
def test_an_included_file_is_not_overwritten_in_its_own_folder(parts: Bench) -> None:
    original = (parts.folder / "parts/props.inc").read_bytes()
    run = ft.update(parts.study(), output=parts.folder / "parts")
    assert (parts.folder / "parts/props.inc").read_bytes() == original
    assert run.results.write_back is not None
    assert run.results.write_back.files == ("updated.bdf", "props_2.inc")
    assert frequencies(run, "after as written") == pytest.approx(parts.modes(run.folder / "updated.bdf"), rel=1e-9)


def refused(bench: Bench, study: Path, folder: Path) -> FemtuneError:
    before = {p: p.read_bytes() for p in bench.folder.rglob("*") if p.is_file()}
    with pytest.raises(FemtuneError) as caught:
        ft.run(study, output=folder)
    assert {p: p.read_bytes() for p in bench.folder.rglob("*") if p.is_file()} == before
    return caught.value


def test_a_deck_called_updated_is_not_overwritten(beam: Bench) -> None:
    (beam.folder / "beam.bdf").rename(beam.folder / "updated.bdf")
    error = refused(beam, beam.study(deck="updated.bdf"), beam.folder)
    assert error.code == "write.overwrites-input"


@pytest.mark.parametrize("link", ["updated.bdf", "results.json", "history.jsonl", "arrays.npz"])
def test_links_to_inputs_are_refused(beam: Bench, link: str) -> None:
    (beam.folder / "run").mkdir()
    (beam.folder / "run" / link).symlink_to(beam.folder / "beam.bdf")
    assert refused(beam, beam.study(), beam.folder / "run").code == "write.overwrites-input"


@pytest.mark.slow
def test_links_to_inputs_are_refused_and_links_to_other_files_replaced(beam: Bench) -> None:
    folder, other = beam.folder / "run", beam.write("notes.txt", "mine")
    study = beam.study()
    ft.update(study)
    (folder / "updated.bdf").unlink()
    (folder / "updated.bdf").hardlink_to(beam.folder / "beam.bdf")
    with pytest.raises(FemtuneError) as caught:
        ft.update(study)
    assert caught.value.code == "write.overwrites-input"
    assert (beam.folder / "beam.bdf").read_text() == beam.text
    for name in ("updated.bdf", "history.jsonl"):
        (folder / name).unlink()
        (folder / name).symlink_to(other)
    ft.update(study)
    assert other.read_text() == "mine"
    assert (folder / "updated.bdf").read_text().startswith("SOL")
    assert not (folder / "updated.bdf").is_symlink()


@pytest.mark.slow
def test_parameter_of_ties_only_is_listed(beam: Bench) -> None:
    tail = """
[[parameter]]
name = "common"
lower = 0.5
upper = 2.0
[[parameter]]
name = "root"
fields = ["PBAR 1 I1"]
tie = "common*1.3/0.85"
[[parameter]]
name = "tip"
fields = ["PBAR 2 I1"]
tie = "common"
"""
    run = ft.update(beam.study(tail))
    assert values(run) == pytest.approx({"common": 0.85, "root": 1.3, "tip": 0.85}, rel=1e-4)
    alert = next(a for a in run.results.alerts if a.code == "write.without-field")
    assert alert.level == "info"
    assert alert.sentence.startswith("common ")
    assert alert.sentence.endswith(" root, tip")
    assert role(run.folder / "updated.bdf", 1, "I1") == pytest.approx(2.6e-7, rel=1e-4)
    assert run.results.update is not None
    spread = {p.name: p.sd for p in run.results.update.parameters}
    assert spread["common"] is not None
    assert spread["root"] == pytest.approx(spread["common"] * 1.3 / 0.85)


@pytest.mark.slow
def test_absolute_parameters_hold_the_fields_value(beam: Bench) -> None:
    tail = beam.parameters.replace("lower = 0.5\nupper = 2.0", "lower = 1e-7\nupper = 4e-7\nabsolute = true")
    run = ft.update(beam.study(tail))
    assert values(run) == pytest.approx({"root": 2.6e-7, "tip": 1.7e-7}, rel=1e-4)
    assert [p.nominal for p in run.results.parameters] == [2e-7, 2e-7]
    assert role(run.folder / "updated.bdf", 4, "I1") == pytest.approx(1.7e-7, rel=1e-4)


@pytest.mark.slow
def test_absolute_start_value_must_be_one(beam: Bench) -> None:
    beam.write("beam.bdf", beam.text.replace("2       1       1.0-3   2.0-7", "2       1       1.0-3   2.1-7"))
    both = (
        '[[parameter]]\nname = "I"\nfields = ["PBAR 1 I1", "PBAR 2 I1"]\nabsolute = true\nlower = 1e-7\nupper = 4e-7\n'
    )
    with pytest.raises(FemtuneError) as caught:
        ft.update(beam.study(both))
    assert caught.value.code == "parameter.absolute-differs"
    run = ft.update(beam.study(both + "nominal = 2e-7\n"))
    assert role(run.folder / "updated.bdf", 1, "I1") == role(run.folder / "updated.bdf", 4, "I1")


@pytest.mark.slow
def test_tied_absolute_parameter_needs_no_start_value(beam: Bench) -> None:
    beam.write("beam.bdf", beam.text.replace("2       1       1.0-3   2.0-7", "2       1       1.0-3   2.1-7"))
    tail = beam.parameters.split("[[parameter]]")[1]
    tied = '[[parameter]]\nname = "both"\nfields = ["PBAR 2 I1", "PBAR 1 I2"]\nabsolute = true\ntie = "2e-7*root"\n'
    run = ft.update(beam.study(f"[[parameter]]{tail}{tied}"))
    assert values(run)["both"] == pytest.approx(2e-7 * values(run)["root"])


@pytest.mark.slow
def test_start_value_other_than_the_decks(beam: Bench) -> None:
    run = ft.update(beam.study(beam.parameters.replace("upper = 2.0", "upper = 2.0\nnominal = 1.2")))
    assert values(run) == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-4)
    softer = beam.text.replace("1.0-3   2.0-7 ", "1.0-3   2.4-7 ")
    started = beam.modes(beam.write("start.bdf", softer))
    assert frequencies(run, "before") == pytest.approx(started, rel=1e-9)
    assert role(run.folder / "updated.bdf", 1, "I1") == pytest.approx(2.6e-7, rel=1e-4)


@pytest.mark.slow
def test_modulus_takes_the_derived_shear_modulus_along(beam: Bench) -> None:
    run = ft.update(beam.study(bounded("E", "MAT1 1 E")))
    deck = run.folder / "updated.bdf"
    assert role(deck, 1, "G") == pytest.approx(role(deck, 1, "E") / 2.6)
    assert role(deck, 1, "E") == pytest.approx(2.1e11 * values(run)["E"], rel=1e-3)
    assert frequencies(run, "after as written") == pytest.approx(beam.modes(deck), rel=1e-9)


@pytest.mark.slow
def test_deck_in_large_field_keeps_its_digits(beam: Bench) -> None:
    line = "PBAR*   1               1               1.000000000-3   2.000000000-7\n*       5.0-7           4.0-7\n"
    old = next(x for x in beam.text.splitlines(keepends=True) if x.startswith("PBAR    1"))
    beam.write("beam.bdf", beam.text.replace(old, line))
    run = ft.update(beam.study())
    assert role(run.folder / "updated.bdf", 1, "I1") == pytest.approx(2e-7 * values(run)["root"], rel=1e-8)
    np.testing.assert_allclose(frequencies(run, "after as written"), frequencies(run, "after"), rtol=1e-5)


def test_a_field_that_cannot_be_written_is_reported_before_the_update(beam: Bench) -> None:
    """The tip's PBAR is a copy of the root's by field replication, so that it has no field of its own."""
    lines = beam.text.splitlines(keepends=True)
    at = next(i for i, line in enumerate(lines) if line.startswith("PBAR    2"))
    lines[at - 1 : at + 1] = ["PBAR,1,1,1.0-3,2.0-7,5.0-7,4.0-7\n", "=,*(1),==\n"]
    beam.write("beam.bdf", "".join(lines))
    with pytest.raises(FemtuneError) as caught:
        ft.update(beam.study())
    assert caught.value.code == "write.replicated"
    assert not (beam.folder / "run" / "history.jsonl").exists()
