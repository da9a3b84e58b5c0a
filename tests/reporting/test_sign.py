"""The first page of a report answers what a reviewer asks before signing, on two printed pages."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pytest
from tests.loaded import load_module

import femtune as ft
from femtune.steps.correlate.result import CorrelateResult
from femtune.steps.report.approval import approval_of, list_digest
from femtune.steps.run.result import RunResult
from femtune.study.record import InputFile, ReportFacts

_EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "01_building"
published = load_module(_EXAMPLE / "published.py")
make_inputs = load_module(_EXAMPLE / "make_inputs.py")
_CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

QUESTIONS = {
    "What is the verdict?": r"Accepted with reservations: ",
    "Which document, in which revision, by whom?": r"Document EX-01 Revision A Author femtune, example 01",
    "Who prepares, checks and approves it?": r"Prepared femtune, example 01 .*Checked .*Approved ",
    "Which standard, in which edition?": r"Criteria and edition ECSS-E-ST-32-11C \(31 July 2008\)",
    "Which value decides each limit, and where?": r"MAC, ECSS-E-ST-32-11C all paired modes ≥ 0\.9 0\.\d+ \w+: test ",
    "How many test modes were compared?": r"Test modes compared 15 of 21 test modes: BC 5 of 7, NC 5 of 7, SC 5 of 7",
    "Which were left out, and why?": r"Test modes not compared 4a, 4b \(BC, NC, SC\): 4a and 4b are one frame mode",
    "Which are the target modes?": r"Target modes 1, 2, 3, 5, 6; all compared in 3 of 3 configurations",
    "Which heavy modes have no partner?": r"BC 4 10\.\d+ none 0\.0 6\.1 0\.0",
    "Which model, and in which units?": r"Model building\.bdf, units m-kg-s: 14 grid points",
    "Which files exactly?": r"building\.bdf [0-9a-f]{64} building\.uff [0-9a-f]{64} results\.json [0-9a-f]{64}",
    "Which configurations?": r"Configurations BC: elements off: 801, .*; SC: as in the deck",
    "How are model and test held?": r"Supports of the model constrained, SPC set 1: 38 DOFs Boundary in the test ",
    "What is the mass, and was it weighed?": r"Mass BC: model 8081 kg; .*; not weighed",
    "Which damping was measured and used?": r"Damping measured not given by the test Damping used none: undamped modes",
    "Where are the sensors?": r"Sensors 6 measured DOFs at 2 points.*Sensors on the model: BC, NC, SC\.",
    "How was the structure excited?": r"Excitation ambient vibration",
    "Are the shapes orthogonal?": r"orthogonality lowest MAC 0\.99\d; cross-orthogonality of the pairs at least 0\.9",
    "What changed, and how certain is it?": r"What changed .*PBAR 1 I1 m⁴ 1\.509e−5 9\.28\d*e−6 5\.\d+e−6 … 1\.\d+e−5",
    "What was not tested?": r"Data held out none: .*Sturm check no mode was missed .*What stays open .*linearity",
}  # fmt: skip
"""What a certifying reviewer asks of the demonstration, and what answers it."""


class _Texts(HTMLParser):
    """The text of the page between two elements, with the alternative texts of pictures."""

    def __init__(self) -> None:
        super().__init__()
        self.parts: list[str] = []
        self._silent = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._silent = tag in ("style", "script")

    def handle_endtag(self, tag: str) -> None:
        self._silent = False

    def handle_data(self, data: str) -> None:
        if not self._silent:
            self.parts.append(data)


def _first_pages(page: str) -> str:
    """The page as far as the first section goes: its head, header, first section and approval."""
    return page[: page.index("</section>")] + "</section></main></div></body></html>"


def _text(page: str) -> str:
    reader = _Texts()
    reader.feed(page)
    return " ".join(" ".join(reader.parts).split())


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The study of the demonstration."""
    folder = tmp_path_factory.mktemp("building")
    written: Path = make_inputs.write_inputs(folder)
    return written


@pytest.fixture(scope="module")
def run(study: Path) -> RunResult:
    return ft.run(study)


@pytest.fixture(scope="module")
def first(run: RunResult) -> str:
    """The first section of its report."""
    assert run.report is not None
    return _first_pages(run.report.read_text("utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("question", QUESTIONS)
def test_the_first_pages_answer(question: str, first: str) -> None:
    text = _text(first)
    assert re.search(QUESTIONS[question], text), text


def test_there_are_twenty_questions_on_the_page_of_the_guide() -> None:
    guide = (Path(__file__).resolve().parents[2] / "docs" / "guide" / "report.md").read_text("utf-8")
    table = guide.split("| question | answer |")[1].split("\n\n")[0]
    assert table.count("?") == len(QUESTIONS) == 20


@pytest.mark.slow
@pytest.mark.skipif(_CHROMIUM is None, reason="no chromium on this machine")
def test_they_are_two_printed_pages(first: str, tmp_path: Path) -> None:
    """Printed alone, the head of the page and its first section fill two sheets; a third section would add one."""

    def sheets(html: str, name: str) -> int:
        page, printed = tmp_path / f"{name}.html", tmp_path / f"{name}.pdf"
        page.write_text(html, "utf-8")
        command = [str(_CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer",
                   f"--user-data-dir={tmp_path / 'profile'}", f"--print-to-pdf={printed}", page.as_uri()]  # fmt: skip
        subprocess.run(command, capture_output=True, timeout=120, check=True)
        return len(re.findall(rb"/Type\s*/Page\b", printed.read_bytes()))

    assert sheets(first, "first") == 2
    more = first.replace("</section></main>", "</section><section><h2>More</h2></section></main>")
    assert sheets(more, "more") == 3


@pytest.mark.slow
def test_the_digests_are_those_of_the_files(run: RunResult, study: Path, first: str) -> None:
    text = _text(first)
    for path in (study, study.parent / "building.bdf", study.parent / "building.uff", run.folder / "results.json",
                 run.folder / "arrays.npz"):  # fmt: skip
        assert f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}" in text
    assert run.report is not None
    beside = (run.folder / "report.html.sha256").read_text()
    assert beside == f"{hashlib.sha256(run.report.read_bytes()).hexdigest()}  report.html\n"


@pytest.mark.slow
def test_a_digest_is_written_again_and_another_file_is_not(run: RunResult) -> None:
    ft.report(run)
    beside = run.folder / "report.html.sha256"
    kept = beside.read_text()
    beside.write_text("my notes\n")
    with pytest.raises(ft.FemtuneError) as caught:
        ft.report(run)
    assert (caught.value.code, beside.read_text()) == ("run.other-file", "my notes\n")
    beside.write_text(kept)


@pytest.fixture(scope="module")
def correlated(study: Path, tmp_path_factory: pytest.TempPathFactory) -> CorrelateResult:
    return ft.correlate(study, report=tmp_path_factory.mktemp("page") / "correlation.html")


def test_a_correlation_has_the_same_first_page(correlated: CorrelateResult) -> None:
    assert correlated.report is not None
    text = _text(_first_pages(correlated.report.read_text("utf-8")))
    assert text.count("Correlation report Two-storey steel building") == 1
    for said in ("Not accepted: frequency error", "15 of 21 test modes", "Effective masses of the model modes",
                 "ambient vibration", "Prepared femtune, example 01", "What is signed"):  # fmt: skip
        assert said in text
    assert "What changed" not in text


def test_a_plan_has_the_parts_that_apply(study: Path, tmp_path: Path) -> None:
    made = ft.plan(study.with_name("building.bdf"), triaxial=2, modes="1 THRU 3", units="m-kg-s",
                   report=tmp_path / "plan.html")  # fmt: skip
    assert made.report is not None
    text = _text(_first_pages(made.report.read_text("utf-8")))
    assert "Model building.bdf" in text
    assert "Effective masses of the model modes" in text
    assert "Test modes compared" not in text
    assert len(re.findall("[0-9a-f]{64}", text)) == 1


def test_many_inputs_are_signed_by_the_digest_of_their_list() -> None:
    inputs = [InputFile(path=f"part_{i}.bdf", sha256=f"{i:064x}") for i in range(9)]
    approval = approval_of(ReportFacts(author="A. Weber"), inputs, ())
    assert approval.digests == (("list of 9 inputs", list_digest(inputs)),)
    assert approval.roles[0] == ("Prepared", "A. Weber")
    lines = "".join(f"{one.sha256}  {one.path}\n" for one in inputs)
    assert list_digest(inputs) == hashlib.sha256(lines.encode()).hexdigest()
    assert len(approval_of(ReportFacts(), inputs[:3], ()).digests) == 3
