"""The report: what it must say, what it must never leave blank, and what files may not do to it."""

from __future__ import annotations

import base64
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from rich.console import Console

from femtune.document.document import Document, Figure, Section, Table, row
from femtune.document.figures.bars import comac_svg
from femtune.document.figures.matrix import MatrixPicture, matrix_svg
from femtune.errors import FemtuneError
from femtune.reporting.html import html_text, write_html
from femtune.reporting.terminal import print_terminal
from femtune.steps import report_sections
from femtune.steps.report.build import build_report
from femtune.steps.report_source import ReportSource
from femtune.steps.results import Results
from femtune.steps.run.page.short_form import verdict
from femtune.steps.run_folder import read_results, write_results

from .page_scripts import bundle, without_own_scripts


def _section(document: Document, name: str) -> Section:
    return next(s for s in document.sections if s.id == name)


def _texts(section: Section) -> str:
    console = Console(width=400, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    try:
        print_terminal(Document("", "", "info", (), (), (section,)), console)
        return console.export_text()
    finally:
        console.file.close()


def _minimal(data: dict[str, Any]) -> Results:
    return Results.model_validate({"provenance": data["provenance"], "study": data["study"]})


class _Page(HTMLParser):
    """Tags, attributes and text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_the_sections_stand_in_their_order(document: Document) -> None:
    ids = [s.id for s in document.sections]
    assert ids == [t.id for t in report_sections()]
    assert (ids[0], ids[-1]) == ("summary", "provenance")
    assert all(s.blocks for s in document.sections)


@pytest.mark.slow
def test_a_run_folder_alone_gives_the_same_report_byte_by_byte(
    results: Results, document: Document, arrays: dict[str, Any], tmp_path: Path
) -> None:
    write_results(tmp_path, results, arrays)
    assert html_text(build_report(*read_results(tmp_path))) == html_text(document)


def test_the_key_numbers_are_those_of_the_pairs(results: Results, document: Document) -> None:
    pairs = [p for c in results.correlations if c.stage == "before" for p in c.pairs]
    mean = np.mean([abs(100 * (p.model_freq_hz / p.test_freq_hz - 1)) for p in pairs])
    text = _texts(_section(document, "summary"))
    assert f"{mean:.2f} % →" in text
    assert "4.38 % → 0.78 %" in text
    assert f"{min(p.mac or 1.0 for p in pairs):.3f} →" in text


def test_the_last_stage_is_that_of_the_written_values(results: Results) -> None:
    assert ReportSource(results, {}).final_version == "after as written"


def test_the_verdict_names_bounds_and_undetermined_combinations(results: Results) -> None:
    sentence, level = verdict(ReportSource(results, {}))
    assert "1 parameter is at a bound" in sentence
    assert "1 combination of parameters undetermined" in sentence
    assert level == "warning"


def test_the_report_says_which_point_the_result_is(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    multipliers = [{"parameter": "Icx2", "value": 0.5}, {"parameter": "rho", "value": -0.1}]
    data["update"] |= {
        "ok": True,
        "chi_square": 13.56,
        "certificate": {"projected_gradient": 2e-6, "predicted_decrease": 1e-12, "multipliers": multipliers},
    }
    document = build_report(Results.model_validate(data), arrays)
    text = " ".join(_texts(_section(document, "convergence")).split())
    assert "The result is a minimum within the bounds: χ² = 13.56." in text
    assert "2 parameters at a bound, 1 of which would fit better inside the bounds" in text
    data["update"]["smallest_change"] = {
        "chi_square": 13.56, "allowed": 0.25, "increase": 0.24, "weight": 0.3, "size": 2.0, "optimum_size": 7.5,
        "optimum": [1.0] * len(data["update"]["history_parameters"]), "optimum_at_bound": ["Icx2"],
    }  # fmt: skip
    document = build_report(Results.model_validate(data), arrays)
    text = " ".join(_texts(_section(document, "convergence")).split())
    assert "exceeds this minimum by at most 0.25: χ² is 13.56 at the minimum, and 0.24 more in the result" in text
    assert "2 prior standard deviations long, against 7.5 at the minimum" in text
    assert "where Icx2 would be at a bound" in text


def test_the_report_tells_long_steps(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    def text() -> str:
        return " ".join(_texts(_section(build_report(Results.model_validate(data), arrays), "convergence")).split())

    assert "long step" not in text()
    data["update"]["history"][1]["long_step"] = True
    assert "1 long step followed, at iteration 1; the objective function may have increased there" in text()


def test_a_failed_update_is_a_problem(data: dict[str, Any]) -> None:
    message = "stopped because no step of any length reduces the objective; the best point is kept"
    data["update"] |= {"ok": False, "status": "STALLED", "message": message}
    sentence, level = verdict(ReportSource(Results.model_validate(data), {}))
    assert message in sentence
    assert "did not reach an optimum" in sentence
    assert level == "problem"


def test_no_pairs_at_all_is_said(slim: dict[str, Any], arrays: dict[str, Any]) -> None:
    for c in slim["correlations"]:
        c.update(pairs=[], mac_key=None)
    document = build_report(Results.model_validate(slim), arrays)
    assert "no test mode could be paired" in document.verdict
    assert "not tested" in _texts(_section(document, "summary"))


def test_derived_quantities_stand_beside_the_parameters(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    one = {"name": "slab", "expression": "0.12*E_col_1", "unit": "m", "nominal": 0.12, "value": 0.13, "sd": 0.004}
    none = {**one, "name": "root", "value": None, "sd": None, "sd_reason": "its expression is not finite"}
    data["update"]["derived"] = [one, none]
    document = build_report(Results.model_validate(data), arrays)
    for found in (
        _texts(_section(document, "parameters")),
        *(_texts(s) for s in document.short if s.id == "parameters"),
    ):
        for words in ("Derived quantities", "slab", "0.004", "0.13", "0.12*E_col_1", "not finite", "its expression"):
            assert words in found


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (
            "compared",
            ["BC, NC, SC", "4a, 4b", "braces vibrate on their own", "combination of 3 DOFs", "9Z+"],
        ),
        (
            "modes",
            ["left out", "no partner", "pair given in the study", "cluster 1", "MAC gate of 0.50 fails", "+2.30"],
        ),
        ("mode_shapes", ["Not drawn: the model has 9000 lines", "SC"]),
        ("parameters", ["at bound, σ not given", "tied: 0.5*(E_col_1 + E_col_2)", "MAT1 1 E", "−38.50"]),
        ("convergence", ["CONVERGED_AT_BOUNDS", "After iteration 2, NC"]),
        ("identifiability", ["I_beam_1 rises while", "9 of 10 combinations"]),
        ("validation", ["4a", "−0.51", "Damping was not compared."]),
        ("checks", ["PLOTEL", "frame.bdf:88", "RZ of 3 points, 11 to 13", "not measured", "POST"]),
        ("write_back", ["2.1+11", "1.2915+11", "updated.bdf:41"]),
        ("criteria", ["≤ 5 %", "≥ 0.9", "fail", "that were not tested"]),
        ("method", ["Gauss-Newton", "90 mode shape residuals"]),
        ("provenance", ["femtune run study.toml", "3f786850"]),
    ],
)
def test_each_section_says_what_it_must(document: Document, section: str, words: list[str]) -> None:
    text = _texts(_section(document, section))
    assert [w for w in words if w not in text] == []


@pytest.mark.parametrize("section", sorted({t.id for t in report_sections()} - {"provenance", "summary", "compared"}))
def test_absent_data_are_said(data: dict[str, Any], section: str) -> None:
    text = _texts(_section(build_report(_minimal(data), {}), section))
    absent = r"[Nn]ot (tested|run|built|compared|computed|matched)|not available|No updated deck|no parameters"
    assert re.search(absent, text), text


def test_correlation_without_shapes_and_without_update(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    data["correlations"] = [c for c in data["correlations"] if c["stage"] == "before"]
    for c in data["correlations"]:
        c.update(dict.fromkeys((k for k in c if k.endswith("_key")), None), comac=[])
        c["pairs"] = [{**p, "mac": None} for p in c["pairs"]]
    data |= {"update": None, "selection": None, "write_back": None, "validation": None}
    document = build_report(Results.model_validate(data), {})
    assert "without an update" in document.verdict
    assert "MAC: not tested" in _texts(_section(document, "mac"))
    assert "COMAC: not tested" in _texts(_section(document, "comac"))
    assert "not tested" in _texts(_section(document, "modes"))


@pytest.mark.slow
def test_the_file_is_small_and_loads_nothing(document: Document, tmp_path: Path) -> None:
    path = write_html(document, tmp_path / "report.html")
    text = without_own_scripts(path.read_text("utf-8"))
    assert len(text) < 2_000_000
    addresses = [a for _, attributes in _Page(text).tags for a in (attributes.get("src"), attributes.get("href")) if a]
    assert addresses
    assert [a[:40] for a in addresses if not a.startswith(("#", "data:image/svg+xml;base64,"))] == []
    assert "@import" not in text
    assert "url(" not in text


@pytest.mark.slow
def test_the_page_forbids_other_scripts_and_links_reach_their_sections(document: Document) -> None:
    text = html_text(document)
    page = _Page(without_own_scripts(text))
    policy = next(a["content"] for t, a in page.tags if t == "meta" and a.get("http-equiv"))
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy
    allowed = {name: set(hashes.split()) for name, hashes in re.findall(r"(script|style)-src ([^;]*)", policy)}
    (style,) = re.findall(r"<style>(.*?)</style>", text, re.DOTALL)
    assert allowed == {"style": {_hash(style)}, "script": {_hash(bundle("page")), _hash(bundle("viewer"))}}
    assert not [a for _, a in page.tags if "style" in a]
    ids = [a["id"] for _, a in page.tags if "id" in a]
    assert len(ids) == len(set(ids))
    assert {a["href"] for t, a in page.tags if t == "a"} == {f"#{i}" for i in ids}


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


_HOSTILE = "<script>alert(1)</script>\"><img src=x onerror=alert(2)>{{7*7}}$\\frac$\x1b[31m\x00'--><style>"


def _poisoned(value: Any) -> Any:
    """The same data with every text hostile that may be hostile."""
    names = "title reason sentence path remark test_file how message bibtex text command where old_text new_text file"
    free = {*names.split(), "first_file", "unit", "description", "card", "deck_file", "dof"}
    if isinstance(value, dict):
        return {k: _HOSTILE if k in free and isinstance(v, str) else _poisoned(v) for k, v in value.items()}
    return [_poisoned(v) for v in value] if isinstance(value, list | tuple) else value


def _with_hostile_labels(data: dict[str, Any]) -> dict[str, Any]:
    for c in data["correlations"]:
        renamed = {label: f"{label}{_HOSTILE}" for label in c["mac_test_labels"]}
        c["pairs"] = [{**p, "test_label": renamed[p["test_label"]]} for p in c["pairs"]]
        c["mac_test_labels"] = list(renamed.values())
    return data


@pytest.fixture
def hostile(slim: dict[str, Any], arrays: dict[str, Any]) -> Document:
    """The report of results whose texts all attack it."""
    return build_report(Results.model_validate(_with_hostile_labels(_poisoned(slim))), arrays)


@pytest.mark.slow
def test_what_comes_from_files_stays_text(hostile: Document) -> None:
    text = without_own_scripts(html_text(hostile))
    page = _Page(text)
    assert {t for t, _ in page.tags} & {"script", "iframe", "object", "embed", "link", "base", "form"} == set()
    assert [a for _, a in page.tags if any(name.startswith("on") for name in a)] == []
    assert any("<script>alert(1)</script>" in word for word in page.words)
    assert "\x00" not in text
    assert "\x1b" not in text
    assert any("{{7*7}}" in word for word in page.words)


@pytest.mark.slow
def test_pictures_hold_no_markup_of_labels(hostile: Document) -> None:
    figures = [b for s in hostile.sections for b in s.blocks if isinstance(b, Figure)]
    assert len(figures) >= 5
    elements = [e for f in figures for e in ElementTree.fromstring(f.svg).iter()]
    assert any("<script>" in (e.text or "") for e in elements)
    assert {str(e.tag).split("}")[-1] for e in elements} <= {
        "svg", "metadata", "RDF", "Work", "type", "format", "creator", "Agent", "title", "defs", "style", "g", "path",
        "use", "clipPath", "rect", "image", "text", "tspan", "circle",
    }  # fmt: skip
    assert not [k for e in elements for k in e.attrib if k.lower().startswith("on")]


@pytest.mark.slow
def test_the_pictures_are_sound_xml_and_of_no_network(document: Document) -> None:
    for uri in re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', html_text(document)):
        root = ElementTree.fromstring(base64.b64decode(uri))
        links = [v for e in root.iter() for k, v in e.attrib.items() if k.endswith("href")]
        assert [v[:30] for v in links if not v.startswith(("#", "data:image/png"))] == []


def test_the_terminal_is_not_steered_by_files(data: dict[str, Any], arrays: dict[str, Any]) -> None:
    data["study"]["title"] = "[bold red]x[/] \x1b[2J [link=https://x.org]y[/link]"
    console = Console(width=100, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    print_terminal(build_report(_minimal(data), {}), console)
    console.file.close()
    text = console.export_text()
    assert "[bold red]x[/] \\x1b[2J [link=https://x.org]y[/link]" in text


def test_letters_that_the_font_lacks_do_not_stop_a_picture() -> None:
    assert "梁の剛性" in matrix_svg(MatrixPicture(np.eye(1), ("梁の剛性",), ("a",), "", ""))


@pytest.mark.slow
def test_many_modes_stay_within_the_size(slim: dict[str, Any], arrays: dict[str, Any]) -> None:
    n, m = 40, 50
    c = slim["correlations"][0]
    c |= {"mac_test_labels": [str(i) for i in range(n)], "mac_test_freq_hz": [10.0 + i for i in range(n)], "pairs": [],
          "mac_model_numbers": range(1, m + 1), "mac_model_freq_hz": [10.0 + i for i in range(m)],
          "auto_mac_test_key": None, "auto_mac_model_key": None, "cross_orthogonality_key": None}  # fmt: skip
    arrays[c["mac_key"]] = np.eye(n, m) * 0.9 + 0.05
    document = build_report(Results.model_validate(slim | {"correlations": [c]}), arrays)
    figure = next(b for b in _section(document, "mac").blocks if isinstance(b, Figure))
    assert figure.wide
    width = float(re.search(r'width="([\d.]+)pt"', figure.svg)[1])  # type: ignore[index]
    assert width / m > 18  # points a cell: digits of five points fit
    assert len(without_own_scripts(html_text(document))) < 2_000_000


@pytest.mark.slow
def test_a_report_that_cannot_be_written_is_an_error(document: Document, tmp_path: Path) -> None:
    with pytest.raises(FemtuneError, match="cannot be written") as caught:
        write_html(document, tmp_path / "absent" / "report.html")
    assert caught.value.code == "run.unwritable"


def test_a_row_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="2 columns"):
        Table("t", (Table.__dataclass_fields__, 2), (row("1"),))  # type: ignore[arg-type]


def test_matplotlib_settings_of_the_reader_have_no_influence() -> None:
    plain = comac_svg(["a"], [0.5], [0.9])
    with matplotlib.rc_context({"font.size": 30.0, "axes.grid": True, "text.usetex": True}):
        assert comac_svg(["a"], [0.5], [0.9]) == plain


def test_a_matrix_of_a_thousand_modes_draws_what_stands_out() -> None:
    names = tuple(map(str, range(1000)))
    drawn = matrix_svg(MatrixPicture(np.eye(1000) + 0.01, names, names, "", ""))
    assert drawn.count("<rect") < 1100
