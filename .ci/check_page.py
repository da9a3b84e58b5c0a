"""Open pages in headless Chromium and check them as a reader's browser would show them.

python .ci/check_page.py [page.html …]     without a path: the newest report, and pages of modes, below examples/

Checked: a page loads nothing from elsewhere, nor do its pictures, writes nothing to the browser's console, has a title
and a heading, its inner links lead somewhere, all its pictures hold data, and it is not blank. Standard library only.
"""

from __future__ import annotations

import base64
import os
import re
import shutil
import subprocess
import sys
import tempfile
from html.parser import HTMLParser
from pathlib import Path

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# No network: whatever the page asks for fails and shows up on the console.
_FLAGS = [
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"),
    *("--disable-extensions", "--virtual-time-budget=8000", "--enable-logging=stderr", "--window-size=1200,1600"),
]
_NO_NETWORK = "--host-resolver-rules=MAP * ~NOTFOUND"
_LOADS = {"script": "src", "img": "src", "iframe": "src", "link": "href", "source": "src", "object": "data"}
_SVG = "data:image/svg+xml;base64,"
_BLANK_PNG_BYTES = 12_000
# what the browser says of itself on a machine without a graphics card
_OF_DRIVER = ("GL Driver Message", "fallback to software WebGL")


class _Page(HTMLParser):
    """Collects what a page loads, links to, and names."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.ids: set[str] = set()
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.tags.add(tag)
        self.ids |= {given[name] for name in ("id", "name") if name in given}
        if tag in _LOADS and _LOADS[tag] in given:
            self.loads.append(given[_LOADS[tag]])
        if tag == "a" and given.get("href", "").startswith("#"):
            self.links.append(given["href"][1:])


def _pages() -> list[Path]:
    """The newest report, and all other pages in run folders of the examples."""
    found = sorted((p for p in Path("examples").rglob("run*/*.html") if p.is_file()), key=lambda p: p.stat().st_mtime)
    reports = [p for p in found if p.name == "report.html"]
    return reports[-1:] + [p for p in found if p not in reports]


def _chromium(*arguments: str) -> subprocess.CompletedProcess[str]:
    program = next(filter(None, map(shutil.which, _NAMES)))
    with tempfile.TemporaryDirectory() as profile:
        command = [program, *_FLAGS, _NO_NETWORK, f"--user-data-dir={profile}", *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def _problems_of_markup(dom: str) -> list[str]:
    page = _Page()
    page.feed(dom)
    problems = [f"loads {what[:80]!r} from elsewhere" for what in page.loads if not what.startswith("data:")]
    problems += [f"a picture or script without data: {what!r}" for what in page.loads if what == "data:,"]
    problems += [f"the link #{link} leads nowhere" for link in page.links if link and link not in page.ids]
    problems += [f"no <{tag}>" for tag in ("title", "h1", "table") if tag not in page.tags]
    if any(_loads_more(what) for what in page.loads):
        problems.append("a picture loads from elsewhere")
    if re.search(r"url\(\s*['\"]?(https?:)?//", dom):
        problems.append("a style loads from elsewhere")
    return problems


def _loads_more(address: str) -> bool:
    """True for a picture that asks for more than what it holds."""
    if not address.startswith(_SVG):
        return False
    drawn = base64.b64decode(address.removeprefix(_SVG)).decode("utf-8")
    return any(not to.startswith(("#", "data:")) for to in re.findall(r'\bhref\s*=\s*["\']([^"\']*)', drawn))


def _problems_of_picture(address: str) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "page.png"
        _chromium(f"--screenshot={picture}", address)
        size = picture.stat().st_size if picture.exists() else 0
    return [] if size > _BLANK_PNG_BYTES else [f"the page looks blank: its picture has {size} bytes"]


def check(report: Path) -> list[str]:
    """What is wrong with the page, in words."""
    address = report.resolve().as_uri()
    shown = _chromium("--dump-dom", address)
    lines = (line for line in shown.stderr.splitlines() if "CONSOLE" in line)
    console = [line for line in lines if not any(text in line for text in _OF_DRIVER)]
    return _problems_of_markup(shown.stdout) + console + _problems_of_picture(address)


def main() -> int:
    """Exit code 0 where nothing is wrong, or there is no Chromium to look with."""
    if not any(map(shutil.which, _NAMES)):
        print("SKIPPED: no Chromium on this machine, the page was not looked at")
        return 0
    pages = [Path(a) for a in sys.argv[1:]] or _pages()
    if not pages or not all(page.is_file() for page in pages):
        print("no page to look at: run 'make demo' first", file=sys.stderr)
        return 1
    return max(map(_tell, pages))


def _tell(page: Path) -> int:
    problems = check(page)
    print(f"{page} ({os.path.getsize(page) / 1e6:.1f} MB): {len(problems)} problems")
    print("".join(f"  {problem}\n" for problem in problems), end="")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
