"""What the terminal shows of single steps."""

from __future__ import annotations

import io
from typing import Any

import pytest
from rich.console import Console

from femtune.document.document import Document, Table, column_groups, columns, row, without_column
from femtune.document.numbers import sensitivity
from femtune.reporting.terminal import print_terminal
from femtune.steps.correlate.terminal import correlation_document
from femtune.steps.info.page import checks
from femtune.steps.info.terminal import info_document
from femtune.steps.modes.page.frequencies import modes_document
from femtune.steps.report_source import ReportSource, Subject
from femtune.steps.results import Results
from femtune.steps.select.page import page_table, selection_document
from femtune.steps.select.record.identifiability import SelectionResults
from femtune.steps.subject import subject_of

SUBJECT = Subject("Frame", "frame.bdf", "m", "kg", "Deck", True)


def _printed(document: Document) -> str:
    stream = io.StringIO()
    print_terminal(document, Console(file=stream, width=100))
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines())


def _flat(document: Document) -> str:
    return " ".join(_printed(document).split())


def _before(data: dict[str, Any], arrays: dict[str, Any]) -> Document:
    found = [c for c in Results.model_validate(data).correlations if c.stage == "before"]
    return correlation_document(SUBJECT, found, arrays)


def _info(data: dict[str, Any]) -> Document:
    model = Results.model_validate(data).model
    assert model is not None
    return info_document(SUBJECT, model)


def _selection(data: dict[str, Any], rows: int = 3) -> SelectionResults:
    names = data["selection"]["column_labels"]
    data["selection"]["sensitivities"] = [
        {"configuration": "BC", "test_label": str(i), "percent_per_percent": [0.5, *[1e-18] * (len(names) - 1)]}
        for i in range(rows)
    ]
    return SelectionResults.model_validate(data["selection"])


def test_info_says_what_was_read_and_checked(data: dict[str, Any]) -> None:
    text = _flat(_info(data))
    assert "Rigid-body check: passed in BC, NC and SC." in text
    assert "Read: GRID 24, CBAR 32, PBAR 10, MAT1 4." in text
    assert "PLOTEL 2 frame.bdf:88 has no stiffness and no mass" in text
    assert "PARAM ignored (no output file of that kind is written): POST=-1." in text
    assert "6053.2 kg, measured 6120 kg, difference −1.09 %" in text
    assert "Inertia about the centre of gravity, kg·m² x y z x 8100 12 0 y 12 7700 0 z 0 0 9200" in text


def test_energies_are_shown_only_where_the_check_failed(data: dict[str, Any]) -> None:
    assert "RX" not in _printed(_info(data)).replace("RZ+", "")
    check = data["model"]["configurations"][1]["rigid_body_check"]
    check |= {"verdict": "fail", "grounded": True, "relative_energies": [3e-18, 0, 0, 0, 0, 0.02]}
    check["grounding_elements"] = [{"card": "CELAS2", "element": 71, "motion": "RZ", "relative_energy": 0.25}]
    check["worst_dofs"] = [{"dof": "7Y+", "force": 12.5}]
    text = _flat(_info(data))
    assert "Rigid-body check: passed in BC and SC; failed in NC." in text
    assert "X Y Z RX RY RZ < 1e−12 0 0 0 0 0.02" in text
    assert "Element Rigid motion Relative energy CELAS2 71 RZ 0.25" in text
    assert "7Y+ 12.5" in text


def test_long_tables_of_a_failed_check_are_cut_and_counted(data: dict[str, Any]) -> None:
    check = data["model"]["configurations"][1]["rigid_body_check"]
    check |= {"verdict": "fail", "grounded": True}
    one = {"card": "CELAS2", "motion": "RZ", "relative_energy": 0.25}
    check["grounding_elements"] = [{**one, "element": 70 + i} for i in range(10)]
    check["worst_dofs"] = [{"dof": f"{i}Y+", "force": 0.5} for i in range(1, 7)]
    text = _flat(_info(data))
    assert "CELAS2 74 RZ" in text
    assert "CELAS2 75" not in text
    assert "and 5 more rows. Elements that are strained" in text
    assert "and 1 more row. Residual forces and moments" in text
    assert "above 1e−8 the model is constrained" in text


def test_a_passed_check_has_no_tables(data: dict[str, Any]) -> None:
    check = data["model"]["configurations"][1]["rigid_body_check"]
    check["grounding_elements"] = [{"card": "CELAS2", "element": 71, "motion": "RZ", "relative_energy": 0.25}]
    assert "constrain the model to ground" not in _flat(_info(data))


def test_held_dofs_are_told_by_kind_and_range(data: dict[str, Any]) -> None:
    held = [{"dof": f"{n}{d}+", "reason": "nothing"} for n in range(1, 151) for d in ("RX", "RY")]
    held += [{"dof": f"{n}RZ+", "reason": "nothing"} for n in (200, 202, 203)]
    held += [{"dof": "7S+", "reason": "too soft"}]
    data["model"]["configurations"][0]["held_dofs"] = held
    text = _flat(_info(data))
    assert "303 DOFs, nothing: RX RY of 150 points, 1 to 150; RZ of 3 points, 200, 202 to 203" in text
    assert "1 DOF, too soft: S of 1 point, 7" in text
    assert "AUTOSPC 304 DOFs constrained" in text
    assert "lists each" not in text


def test_many_ranges_of_held_dofs_are_cut(data: dict[str, Any]) -> None:
    held = [{"dof": f"{n}RX+", "reason": "nothing"} for n in range(1, 2449, 2)]
    data["model"]["configurations"][0]["held_dofs"] = held
    text = _flat(_info(data))
    assert "1224 DOFs, nothing: RX of 1224 points, 1, 3, 5, 7, 9 and 1219 more (results.json, or femtune info" in text
    assert "2001" not in text


def test_warnings_come_first_and_what_repeats_is_counted(data: dict[str, Any]) -> None:
    quiet = [{"level": "info", "code": "deck.free-end", "sentence": f"note {i}"} for i in range(9)]
    repeated = {"level": "info", "code": "deck.ignored-cards", "sentence": "2 PLOTEL cards are ignored"}
    data["model"]["notices"] = [*quiet, repeated, *data["model"]["notices"]]
    text = _flat(_info(data))
    assert text.index("warning: Two cards") < text.index("info: note 0; and 8 more notices of this kind")
    assert "2 PLOTEL cards are ignored" not in text


def test_modes_stand_side_by_side(data: dict[str, Any]) -> None:
    first, second = Results.model_validate(data).modes[:2]
    free = second.model_copy(update={"configuration": "free", "freq_hz": (0.0, 12.5), "rigid_body_modes": 1})
    text = _flat(modes_document(SUBJECT, [first, free]))
    assert (
        f"Mode {first.configuration} free 1 {first.freq_hz[0]:.3f} rigid body 2 {first.freq_hz[1]:.3f} 12.500" in text
    )


@pytest.mark.parametrize(
    ("count", "words"), [(3, "differ in BC"), (None, "not tested in BC"), (2, "No mode was missed")]
)
def test_a_missed_mode_is_said_first(data: dict[str, Any], count: int | None, words: str) -> None:
    one = Results.model_validate(data).modes[0]
    one = one.model_copy(update={"configuration": "BC", "sturm_count": count, "modes_below_shift": 2})
    assert words in modes_document(SUBJECT, [one]).verdict


def test_the_comparison(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    text = _flat(_before(data, arrays))
    assert "1 3.120 1 3.179 +1.90 0.980 close modes, cluster 1" in text
    assert "7 24.200 best candidate is model mode 7: MAC 0.31, the MAC gate of 0.50 fails" in text
    assert text.count("braces vibrate on their own") == 1
    assert "BC, NC, SC 4a, 4b braces" in text
    assert f"MAC, test modes by model modes 1 2 3 4 5 6 7 1 {arrays['mac/BC/before'][0, 0]:.2f}" in text
    assert "Cross-orthogonality: not tested (the model was not reduced to the sensors)." in text
    assert "COMAC, lowest of 6 DOFs: 0.879 at 2X+" in text
    assert "MAC, ECSS-E-ST-32-11C ≥ 0.9 0.78 fail mode 6" in text


def test_a_wide_matrix_is_left_to_the_report(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    one = next(c for c in Results.model_validate(data).correlations if c.stage == "before")
    wide = one.model_copy(
        update={"mac_model_numbers": tuple(range(1, 17)), "mac_model_freq_hz": tuple(map(float, range(16)))}
    )
    assert one.mac_key is not None
    arrays[one.mac_key] = arrays[one.mac_key].repeat(3, axis=1)[:, :16]
    text = _flat(correlation_document(SUBJECT, [wide], arrays))
    assert "MAC, test modes by model modes: 5 by 16, too wide for a terminal" in text


def test_no_key_and_no_residual_label_reaches_the_terminal(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    selection = _selection(data)
    text = _flat(selection_document(SUBJECT, selection)) + _flat(_before(data, arrays))
    keys = [v for c in data["correlations"] for k, v in c.items() if k.endswith("_key") and v]
    assert not any(word in text for word in (*keys, "jacobian_key", *selection.row_labels))


def test_selection(data: dict[str, Any]) -> None:
    document = selection_document(SUBJECT, _selection(data))
    text = _flat(document)
    assert document.verdict.startswith("The data determine 9 of 10 combinations")
    assert "BC 0 0.500 0 0 0" in text
    assert "I_beam_1 0.71" in text
    assert "Singular values of the scaled Jacobian: 41, 22, 9.4" in text
    assert "weak 0.4 0.93 I_beam_6 alone" in text


def test_many_parameters_go_below_each_other(data: dict[str, Any]) -> None:
    selection = _selection(data)
    names = tuple(f"E_of_{i}" for i in range(40))
    wide = [
        s.model_copy(update={"percent_per_percent": tuple(0.01 * j for j in range(40))})
        for s in selection.sensitivities
    ]
    many = selection.model_copy(update={"column_labels": names, "sensitivities": tuple(wide)})
    printed = _printed(selection_document(SUBJECT, many))
    assert all(name in printed.split() for name in names)
    assert "0.390" in printed
    assert max(map(len, printed.splitlines())) <= 100


def test_columns_fill_the_width() -> None:
    assert column_groups(("a", "b", "c" * 60, "d"), 20, 28) == [("a", "b"), ("c" * 60,), ("d",)]
    assert column_groups((), 20, 8) == []
    assert column_groups(("a" * 200,), 20, 8) == [("a" * 200,)]


@pytest.mark.parametrize(("number", "text"), [(-1e-17, "0"), (0.0, "0"), (-0.0701, "−0.070"), (0.0006, "0.001")])
def test_sensitivities_without_noise(number: float, text: str) -> None:
    assert sensitivity(number) == text


@pytest.mark.parametrize(("rows", "tables"), [(40, 1), (41, 0), (0, 0)])
def test_the_page_has_the_table_where_it_fits(data: dict[str, Any], rows: int, tables: int) -> None:
    assert len(page_table(_selection(data, rows))) == tables


def test_the_page_has_no_table_of_many_parameters(data: dict[str, Any]) -> None:
    many = _selection(data).model_copy(update={"column_labels": tuple(map(str, range(13)))})
    assert page_table(many) == []


def test_the_page_names_grounding_elements(data: dict[str, Any]) -> None:
    def titles() -> list[str]:
        return [b.title for b in checks(ReportSource(Results.model_validate(data), {})) if isinstance(b, Table)]

    title = "Elements that constrain the model to ground"
    assert title not in titles()
    check = data["model"]["configurations"][0]["rigid_body_check"]
    check["grounding_elements"] = [{"card": "CELAS2", "element": 71, "motion": "RZ", "relative_energy": 0.25}]
    assert title in titles()


def test_a_column_is_taken_out() -> None:
    table = without_column(Table("t", columns("a", ">b", "c"), (row("1", "2", "3"),)), "b")
    assert [c.title for c in table.columns] == ["a", "c"]
    assert [cell.text for cell in table.rows[0]] == ["1", "3"]


def test_a_deck_alone_has_no_units(tmp_path: Any) -> None:
    assert subject_of(tmp_path / "a.bdf") == Subject("a.bdf", str(tmp_path / "a.bdf"), "", "", "Deck", True)
    (tmp_path / "a.bdf").touch()
    (tmp_path / "s.toml").write_text('[study]\ntitle = "T"\ndeck = "a.bdf"\nunits = "mm-t-s"\n')
    assert subject_of(tmp_path / "s.toml") == Subject("T", "a.bdf", "mm", "t", "Deck", True)
