"""A real browser opens a report made of hostile texts: nothing runs, nothing is fetched, nothing is complained of."""

from __future__ import annotations

import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from femtune.reporting.html import write_html
from femtune.steps.report.build import build_report
from femtune.steps.results import Results

from .page_scripts import without_own_scripts

_CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
_PROBES = ("<script>document.title='RAN'</script>", '"><img src=x onerror="document.title=\'RAN\'">')

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(_CHROMIUM is None, reason="no chromium on this machine"),
]


class _Images(HTMLParser):
    """Attributes of all images, as the browser reads them."""

    def __init__(self, dom: str) -> None:
        super().__init__()
        self.attributes: list[dict[str, str | None]] = []
        self.feed(dom)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            self.attributes.append(dict(attrs))


def _open(page: Path, profile: Path) -> tuple[str, str]:
    """The page after loading, and what the browser logged."""
    command = [
        str(_CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        f"--user-data-dir={profile}", "--enable-logging=stderr", "--virtual-time-budget=2000",
        "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout, done.stderr


def _said(log: str) -> list[str]:
    """What the page wrote to the console; the browser adds messages of its own without a graphics card."""
    of_driver = ("GL Driver Message", "fallback to software WebGL")
    return [line for line in log.splitlines() if "CONSOLE" in line and not any(text in line for text in of_driver)]


def _hostile(data: dict[str, Any], probe: str) -> Results:
    data["study"] |= {"title": probe, "deck_file": probe, "description": probe}
    data["provenance"]["input_files"][0]["path"] = probe
    data["model"]["notices"][0] |= {"sentence": probe, "where": probe}
    for c in data["correlations"]:
        c["pairs"] = [{**p, "test_label": p["test_label"] + probe} for p in c["pairs"]]
        c["mac_test_labels"] = [label + probe for label in c["mac_test_labels"]]
        c["comac"] = [{**e, "dof": e["dof"] + probe} for e in c["comac"]]
    return Results.model_validate(data)


@pytest.mark.parametrize("probe", _PROBES)
def test_hostile_texts_do_nothing(slim: dict[str, Any], arrays: dict[str, Any], tmp_path: Path, probe: str) -> None:
    document = build_report(_hostile(slim, probe), arrays)
    page = write_html(document, tmp_path / "report.html")
    dom, log = _open(page, tmp_path / "profile")
    assert "<title>RAN</title>" not in dom
    assert "<script" not in without_own_scripts(dom)
    images = _Images(dom)
    assert images.attributes
    assert all(set(a) == {"src", "alt"} for a in images.attributes)
    assert _said(log) == []
    assert len(re.findall(r"<section ", dom)) == sum(not section.folded for section in document.sections)
    assert not re.findall(r'(?:src|href)="(?!#|data:image/svg\+xml;base64,)[^"]*"', dom)


def test_the_probe_would_be_seen(tmp_path: Path) -> None:
    """Without escaping the same browser runs the script: the test above can fail."""
    page = tmp_path / "open.html"
    page.write_text(f"<title>x</title><p>{_PROBES[0]}</p>")
    assert "<title>RAN</title>" in _open(page, tmp_path / "profile")[0]
