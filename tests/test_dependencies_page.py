"""The page on dependencies says what the pages that it cites and the program say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]
_PAGE = " ".join((_ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8").split())
_SOURCE = _ROOT / "src" / "femtune"
_OWN = {
    "worker processes": ("executor/processes.py", "executor/worker.py"),
    "start of SLEPc": ("model/distributed/launch.py", "model/distributed/processes.py", "model/distributed/watch.py"),
    "runs of external solvers": ("runs/*.py",),
    "XLSX files of the report": ("../../web/src/xlsx.ts",),
    "MDF files of version 4": ("files/records/mdf.py",),
    "packages that load a module": ("_lazy.py",),
    "check of arguments": ("arguments.py",),
}
"""Own code where a library exists: the beginning of its row, and its files."""


def _number_after(text: str, form: str) -> float:
    found = re.search(form, text)
    assert found is not None, form
    return float(found[1].replace(",", ""))


@pytest.mark.parametrize("own", _OWN)
def test_own_code_has_about_so_many_lines(own: str) -> None:
    stated = _number_after(_PAGE, rf"\| {own}[^|]*\| ([\d,]+) \|")
    files = [path for form in _OWN[own] for path in sorted(_SOURCE.glob(form))]
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)
    assert stated == pytest.approx(lines, rel=0.1)


def _cell(page: str, row: str, column: int) -> float:
    """A number of a table of a page of evidence; the first row that begins so."""
    lines = (_ROOT / "docs" / "evidence" / page).read_text(encoding="utf-8").splitlines()
    cells = next(line for line in lines if line.startswith(f"| {row}")).strip("| ").split("|")
    return float(cells[column])


@pytest.mark.parametrize(
    ("form", "page", "row", "column"),
    [
        (r"ours takes ([\d.]+) s, scikit-learn", "benchmark_surrogates.md", "femtune, Kriging, constant trend", 1),
        (r"scikit-learn ([\d.]+) s, SMT", "benchmark_surrogates.md", "scikit-learn, Gaussian process", 1),
        (r"SMT ([\d.]+) s and OpenTURNS", "benchmark_surrogates.md", "SMT, Kriging", 1),
        (r"and OpenTURNS ([\d.]+) s, with", "benchmark_surrogates.md", "OpenTURNS, Kriging", 1),
        (r"with the same error of ([\de.-]+) at", "benchmark_surrogates.md", "femtune, Kriging, constant trend", 2),
        (
            r"faster than ours: error ([\de.-]+) for",
            "benchmark_surrogates.md",
            "OpenTURNS, polynomial chaos, degree 4",
            2,
        ),
        (r"than ours: error [\de.-]+ for ([\de.-]+), ", "benchmark_surrogates.md", "femtune, polynomial chaos", 2),
        (
            r"for [\de.-]+, ([\d.]+) s for [\d.]+ s \(",
            "benchmark_surrogates.md",
            "OpenTURNS, polynomial chaos, degree 4",
            1,
        ),
        (r"for [\de.-]+, [\d.]+ s for ([\d.]+) s \(", "benchmark_surrogates.md", "femtune, polynomial chaos", 1),
        (r"are analysed in ([\d.]+) s", "benchmark_size.md", "analyse", 1),
        (r"and factorised in ([\d.]+) s on two", "benchmark_size.md", "factorise", 1),
    ],
)
def test_a_number_is_that_of_the_page_that_is_cited(form: str, page: str, row: str, column: int) -> None:
    assert _number_after(_PAGE, form) == pytest.approx(_cell(page, row, column), rel=0.07)
