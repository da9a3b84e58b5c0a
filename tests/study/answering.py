"""The report of a run in a browser, whose live model answers to values and clicks."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from tests.reporting.devtools import OpenPage, opened

from femtune.reporting.html import write_html
from femtune.steps.report.build import build_report
from femtune.steps.run.result import RunResult


@dataclass
class Answering:
    """A run, and its report in a browser."""

    folder: Path
    run: RunResult
    page: OpenPage

    def ask(self, act: str) -> None:
        """Run statements in the page, and wait for the answer to them."""
        before = self._solved()
        self.page.value(f"(() => {{ {act} }})()")
        for _ in range(300):
            if self._solved() != before:
                return
            time.sleep(0.1)
        pytest.fail("the page does not answer")

    def _solved(self) -> object:
        return self.page.value("document.querySelector('.livemodel')?.dataset.solved")

    def wait(self) -> None:
        """Until the page has solved the update."""
        for _ in range(300):
            if self._solved():
                return
            time.sleep(0.1)
        pytest.fail("the live model does not begin")

    def set(self, values: Sequence[float]) -> None:
        """Enter values of the parameters."""
        numbers = "[...document.querySelectorAll('.livemodel .slider input[type=number]')]"
        self.ask(
            f"{numbers}.forEach((e, i) => {{ e.value = {json.dumps(list(values))}[i]; "
            "e.dispatchEvent(new Event('change')); });"
        )
        # the second value may have waited for the answer to the first
        time.sleep(0.25)

    def rows(self, title: str) -> dict[str, list[str]]:
        """Rows of a table of the live model, by their heads."""
        rows = self.page.value(
            f"[...document.querySelectorAll('[aria-label={json.dumps(title)}] tbody tr')]"
            ".map((r) => [...r.cells].map((c) => c.textContent))"
        )
        return {r[0]: r[1:] for r in rows}

    def text(self, selector: str) -> str:
        """The text of an element."""
        return str(self.page.value(f"document.querySelector({json.dumps(selector)}).textContent"))


@contextmanager
def answering_page(run: RunResult, folder: Path) -> Iterator[Answering]:
    """The report of a run once its live model is ready; files go into the folder."""
    report = write_html(build_report(run.results, run.arrays), folder / "report.html")
    with opened(report, folder / "profile") as page:
        found = Answering(folder, run, page)
        found.wait()
        yield found
