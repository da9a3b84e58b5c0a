"""The check of the links of the documentation finds what leads nowhere."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest
from tests.loaded import load_module

_SCRIPT = Path(__file__).resolve().parents[1] / ".ci" / "check_links.py"

GOOD = """<p id="first"><a href="other.html#place">a</a><a href="#first">b</a><img src="_static/p.png">
<a href="https://example.org/x?y=1#z">c</a><a href="sub/">d</a><script>var a = '<a href="gone.html">';</script></p>"""

_WRONG = {
    "other.html#place": ("other.html#gone", "no such place"),
    "#first": ("#second", "no such place"),
    "_static/p.png": ("_static/P.png", "no such file"),
    "https://example.org/x": ("http://example.org/x", "no address of the form"),
    "sub/": ("sub/gone.html", "no such file"),
    '<img src="_static/p.png">': ('<img src="_static/p.png" id="first">', "occurs 2 times"),
}


@pytest.fixture
def script() -> ModuleType:
    return load_module(_SCRIPT, "check_links")


@pytest.fixture
def site(tmp_path: Path) -> Path:
    for folder in ("_static", "sub"):
        (tmp_path / folder).mkdir()
    (tmp_path / "_static" / "p.png").touch()
    (tmp_path / "sub" / "index.html").touch()
    (tmp_path / "other.html").write_text('<h1 id="place">Title</h1>')
    (tmp_path / "page.html").write_text(GOOD)
    return tmp_path


def test_good_links_pass(script: ModuleType, site: Path) -> None:
    assert script.problems(site / "page.html") == []
    (site / "page.md").write_text("[a](other.html) ![p](_static/p.png)\n```\n[code](gone)\n```\n")
    assert script.problems(site / "page.md") == []


@pytest.mark.parametrize("stated", _WRONG)
def test_what_leads_nowhere_is_found(stated: str, script: ModuleType, site: Path) -> None:
    instead, said = _WRONG[stated]
    assert stated in GOOD
    (site / "page.html").write_text(GOOD.replace(stated, instead, 1))
    (problem,) = script.problems(site / "page.html")
    assert said in problem


def test_a_page_of_markdown_with_a_lost_file(script: ModuleType, site: Path) -> None:
    (site / "page.md").write_text("[a](gone.md)")
    assert script.problems(site / "page.md") == ["'gone.md': no such file"]
