"""What a reader of many sensors and two configurations must find, and need not read twice."""

from __future__ import annotations

import re
from typing import Any

import pytest

from femtune.document.document import Figure, FigureRow, KeyNumbers, Listing, Paragraph, Table
from femtune.reporting.html import html_text
from femtune.steps.correlate.page.compared import compared
from femtune.steps.correlate.page.correlation import comac, dropped_sensors, mac
from femtune.steps.modes.page.mode_shapes import mode_shapes
from femtune.steps.modes.page.modes import cluster_paragraphs, modes, sturm
from femtune.steps.report.build import build_report
from femtune.steps.report_source import ReportSource
from femtune.steps.results import Results
from femtune.steps.run.page.summary import summary
from femtune.steps.validate.page import criteria


def _source(data: dict[str, Any], arrays: dict[str, Any] | None = None) -> ReportSource:
    return ReportSource(Results.model_validate(data), arrays or {})


def _table(blocks: list[Any], title: str) -> Table:
    return next(b for b in blocks if isinstance(b, Table) and title in b.title)


def _rows(table: Table) -> list[list[str]]:
    return [[cell.text for cell in cells] for cells in table.rows]


def _column(table: Table, title: str) -> list[str]:
    at = [c.title for c in table.columns].index(title)
    return [cells[at].text for cells in table.rows]


def test_pairs_before_and_after_stand_together(data: dict[str, Any]) -> None:
    last = next(c for c in data["correlations"] if (c["configuration"], c["stage"]) == ("NC", "after as written"))
    last["pairs"] = last["pairs"][:-1]
    table = _table(compared(_source(data)), "Configurations")
    assert _column(table, "Pairs") == ["5 → 5", "5 → 4", "5 → 5"]


def test_sensors_of_a_node_share_a_row(data: dict[str, Any]) -> None:
    data["sensors"][0]["matched"][0]["test_dof"] = "1X-"
    table = _table(compared(_source(data)), "BC: 5 sensors matched, tolerance 0.05 m")
    assert _rows(table)[:2] == [
        ["1", "−X, Y", "101", "0.004", "nearest grid"],
        ["2", "X, Y", "102", "0.004", "nearest grid"],
    ]
    assert _rows(table)[2][:3] == ["1", "RZ", "several"]


@pytest.mark.slow
@pytest.mark.parametrize(("nodes", "folded"), [(24, False), (25, True)])
def test_a_long_table_of_sensors_is_folded(
    data: dict[str, Any], arrays: dict[str, Any], nodes: int, folded: bool
) -> None:
    for s in data["sensors"]:
        s["matched"] = [
            {"test_dof": f"{n}{d}+", "test_node": n, "model_node": n, "distance": 0.0, "how": "nearest"}
            for n in range(1, nodes + 1)
            for d in "XYZ"
        ]
    table = _table(compared(_source(data)), f"{3 * nodes} sensors matched")
    assert len(table.rows) == nodes
    assert table.folded is folded
    page = html_text(build_report(Results.model_validate(data), arrays))
    found = re.findall(r'<details class="table">\s*<summary>([^<]*)</summary>', page)
    assert found == ([table.title] if folded else [])
    assert page.count("<details") == page.count("</details>")


def test_information_is_noted_beside_the_sensors_and_not_in_the_summary(data: dict[str, Any]) -> None:
    data["alerts"].append({"level": "info", "code": "uff.not-measured", "sentence": "14 components", "where": "bc.uff"})
    data["alerts"].append({"level": "info", "code": "update.pairing-changed", "sentence": "the pairing changed"})
    source = _source(data)
    assert {b.level for b in summary(source) if b.kind == "alert"} == {"warning"}
    lines = [item for b in compared(source) if isinstance(b, Listing) for item in b.items]
    assert "14 components [uff.not-measured, bc.uff]" in lines
    assert not any("pairing changed" in line for line in lines)


def test_the_key_numbers_are_explained(data: dict[str, Any]) -> None:
    blocks = summary(_source(data))
    at = next(i for i, b in enumerate(blocks) if isinstance(b, KeyNumbers))
    words = blocks[at + 1]
    assert isinstance(words, Paragraph)
    assert words.tone == "muted"
    assert "15 frequency residuals and 90 mode shape residuals" in words.text
    assert "(15 before, 15 after)" in words.text


def test_a_cluster_says_which_angle_is_which(data: dict[str, Any]) -> None:
    first = data["correlations"][0]
    first["clusters"][0] |= {"test_labels": ["10"], "model_numbers": [10, 11]}
    text = cluster_paragraphs(_source(data).results.correlations[0])[0].text  # type: ignore[union-attr]
    assert text == (
        "Cluster 1: test mode 10 and model modes 10 and 11 are closely spaced and were compared as "
        "subspaces: the largest angle between the two subspaces is 6.2°; the model modes were rotated by 0.3° within "
        "their subspace."
    )


def test_a_cluster_before_the_update_alone_is_told(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Its MAC is that of a subspace, also where the modes are apart after the update."""
    first = data["correlations"][0]
    assert first["stage"] == "before"
    members = [p["test_label"] for p in first["pairs"] if p["cluster"] is not None]
    assert members
    for later in data["correlations"][1:]:
        if later["configuration"] == first["configuration"]:
            later["clusters"] = []
            for pair in later["pairs"]:
                pair["cluster"] = None
    blocks = modes(_source(data, arrays))
    texts = [b.text for b in blocks if isinstance(b, Paragraph)]
    assert any(text.startswith("Before: Cluster 1: test mode") for text in texts)
    table = next(b for b in blocks if isinstance(b, Table))
    remarks = {r[0]: r[-1] for r in _rows(table)}
    assert {remarks[label] for label in members} == {"close modes before, cluster 1"}


def test_a_model_mode_names_its_partner_at_the_other_stage(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    last = next(c for c in data["correlations"] if (c["configuration"], c["stage"]) == ("NC", "after as written"))
    last["unpaired_model"] = [{"model_number": 6, "model_freq_hz": 18.5}]
    table = _table(modes(_source(data, arrays)), "Model modes without a partner")
    rows = {(r[0], r[1]): r[2:4] for r in _rows(table)}
    assert rows["NC", "6"] == ["paired with test mode 6", "18.500"]
    assert rows["NC", "4"] == ["9.640", "–"]
    assert rows["BC", "4"] == ["9.640", "9.640"]


def test_counts_that_agree_take_one_sentence(data: dict[str, Any]) -> None:
    table = sturm(_source(data))[0]
    assert isinstance(table, Table)
    assert _rows(table)[1] == ["BC", "after", "7", "0", "30.000", "7", "7"]
    assert table.note.startswith("No mode was missed")


def test_counts_that_differ_or_are_absent_are_named(data: dict[str, Any]) -> None:
    data["modes"][0]["sturm_count"] = 8
    data["modes"][3] |= {"sturm_count": None, "modes_below_shift": None, "sturm_shift_hz": None}
    data["modes"][3]["sturm_sentence"] = "not tested: the factorisation hides the inertia"
    table = sturm(_source(data))[0]
    assert isinstance(table, Table)
    assert "differ in BC (before)" in table.note
    assert "Not tested in NC (after): the factorisation hides the inertia." in table.note
    assert "No mode was missed" not in table.note
    data["modes"] = []
    assert "not computed" in sturm(_source(data))[0].text  # type: ignore[union-attr]


def test_the_axes_stand_in_the_first_picture_only(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    for c in data["correlations"]:
        c["pairs"] = [*c["pairs"], *c["pairs"][:3]]
    figures = [b for b in mode_shapes(_source(data, arrays)) if isinstance(b, Figure)]
    assert [">x</text>" in f.svg for f in figures] == [True, False, True, False]
    x = float(re.search(r'<text x="([\d.]+)"[^>]*>x</text>', figures[0].svg)[1])  # type: ignore[index]
    y = float(re.search(r'<text [^>]*y="([\d.]+)"[^>]*>x</text>', figures[0].svg)[1])  # type: ignore[index]
    height = float(re.search(r'height="([\d.]+)', figures[0].svg)[1])  # type: ignore[index]
    assert x < 100
    # below the drawings, so that they lie on none of them
    assert height - 32 < y <= height


def test_a_reason_that_holds_for_several_criteria_is_said_once(data: dict[str, Any]) -> None:
    for c in data["correlations"]:
        c["criteria"].append({**c["criteria"][-1], "name": "cross-orthogonality, off the diagonal", "limit": 0.1})
    blocks = criteria(_source(data))
    table = _table(blocks, "not tested")
    assert _rows(table) == [
        [
            "BC, NC, SC",
            "before and after",
            "cross-orthogonality ≥ 0.9; cross-orthogonality, off the diagonal ≥ 0.1",
            "six sensors cannot carry the mass of the model",
        ]
    ]
    assert len(_table(blocks, "Before the update").rows) == 6


def test_the_lowest_five_of_comac_are_named(data: dict[str, Any]) -> None:
    row = next(b for b in comac(_source(data)) if isinstance(b, FigureRow))
    caption = row.figures[0].caption
    assert "0.919 at 2Z+" not in caption
    values = [float(v) for v in re.findall(r"(0\.\d+) at", caption)]
    assert len(values) == 5
    assert values == sorted(values)


def test_cross_orthogonality_has_the_paired_modes_only(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    """The matrix has no values of the others, whose names would stand beside nothing."""
    stages = [c for c in _source(data).results.correlations if c.cross_orthogonality_key and c.stage == "before"]
    rows = [f for b in mac(_source(data, arrays)) if isinstance(b, FigureRow) for f in b.figures]
    alts = [f.alt for f in rows if "Cross-orthogonality before" in f.alt]
    assert stages
    assert alts
    for stage, alt in zip(stages, alts, strict=True):
        assert len(stage.pairs) < len(stage.mac_model_numbers)
        assert f"matrix of {len(stage.pairs)} by {len(stage.pairs)} modes" in alt


def test_sensors_without_a_part_in_cross_orthogonality_are_named(data: dict[str, Any]) -> None:
    data["correlations"][0]["cross_orthogonality_dropped"] = ["1022X+"]
    first, second = _source(data).results.correlations[:2]
    assert dropped_sensors(second) == []
    assert "without 1022X+: it is linearly dependent" in dropped_sensors(first)[0].text  # type: ignore[union-attr]
