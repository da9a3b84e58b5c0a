"""Check every link of the built documentation, and of the pages of the repository, without network.

python .ci/check_links.py docs/_build/html [README.md …]

Checked in HTML: a page, file or picture that is linked to exists, with the same capital letters, and so does the place
in it (#name); a name occurs once in a page. Checked in Markdown: files that are linked to exist. Addresses on the
network are checked for their form only: https, or mailto. Standard library only.
"""

from __future__ import annotations

import os
import re
import sys
from collections import Counter
from functools import cache
from html import unescape
from pathlib import Path
from urllib.parse import unquote, urlsplit

# quotation marks in the text of a page are written &quot;, so that only attributes match
_ATTRIBUTE = re.compile(r"""\s(href|src|poster|id)=(?:"([^"]*)"|'([^']*)')""")
_NOT_SHOWN = re.compile(r"<(script|style)\b[^>]*>.*?</\1>|<!--.*?-->", re.DOTALL)
_MARKDOWN = re.compile(r"(?<!`)!?\[[^\]\n]*\]\(([^()\s]+)(?:\s+\"[^\"]*\")?\)")
_HOST = re.compile(r"[a-z0-9-]+(\.[a-z0-9-]+)+(:\d+)?", re.IGNORECASE)


@cache
def _attributes(page: Path) -> tuple[tuple[str, str], ...]:
    """Names and values of the attributes that link, or name a place."""
    text = _NOT_SHOWN.sub("", page.read_text(encoding="utf-8"))
    return tuple((name, unescape(a or b)) for name, a, b in _ATTRIBUTE.findall(text))


@cache
def _ids(page: Path) -> Counter[str]:
    return Counter(value for name, value in _attributes(page) if name == "id")


@cache
def _names(folder: Path) -> frozenset[str]:
    """The files of a folder, as they are written: some systems do not tell Index.html from index.html."""
    return frozenset(p.name for p in folder.iterdir()) if folder.is_dir() else frozenset()


def _form(link: str) -> str | None:
    """What is wrong with an address on the network."""
    parts = urlsplit(link)
    if parts.scheme == "mailto":
        return None if "@" in parts.path else "no address of mail"
    if parts.scheme != "https" or not _HOST.fullmatch(parts.netloc) or re.search(r"[\s<>]", link):
        return "no address of the form https://host/path"
    return None


def _wrong(page: Path, link: str) -> str | None:
    """What is wrong with a link of a page; None for a good one."""
    if link.startswith("#"):
        return None if page.suffix != ".html" or link == "#" or _ids(page)[unquote(link[1:])] else "no such place"
    return _wrong_from(page.parent, page.suffix, link)


@cache
def _wrong_from(folder: Path, kind: str, link: str) -> str | None:
    """The same of a link to another file, which many pages of a folder have."""
    parts = urlsplit(link)
    if parts.scheme == "data":
        return None
    if parts.scheme or parts.netloc:
        return _form(link)
    target = Path(os.path.normpath(folder / unquote(parts.path)))
    if target.is_dir() and kind == ".html":
        target /= "index.html"
    if target.name not in _names(target.parent):
        return "no such file"
    place = unquote(parts.fragment)
    if place and target.suffix == ".html" and not _ids(target)[place]:
        return "no such place"
    return None


@cache
def _links(page: Path) -> list[str]:
    if page.suffix == ".html":
        return [value for name, value in _attributes(page) if name != "id"]
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    return _MARKDOWN.findall(text)


def problems(page: Path) -> list[str]:
    """What is wrong with the links and names of a page, in words."""
    page = page.resolve()
    found = [f"{link!r}: {wrong}" for link in dict.fromkeys(_links(page)) if (wrong := _wrong(page, link))]
    if page.suffix == ".html":
        found += [f"the name {name!r} occurs {count} times" for name, count in _ids(page).items() if count > 1]
    return found


def main() -> int:
    """Exit code 1 where a link leads nowhere."""
    pages: list[Path] = []
    for given in map(Path, sys.argv[1:]):
        pages += sorted(given.rglob("*.html")) if given.is_dir() else [given]
    if not pages:
        print("no pages: python .ci/check_links.py docs/_build/html", file=sys.stderr)
        return 1
    count, wrong = 0, 0
    outside: set[str] = set()
    for page in pages:
        links = _links(page.resolve())
        count += len(links)
        outside |= {link for link in links if link.startswith("https:")}
        for problem in problems(page):
            print(f"{page}: {problem}", file=sys.stderr)
            wrong += 1
    print(f"{count} links in {len(pages)} pages, {wrong} problems", end="; ")
    print(f"{len(outside)} addresses on the network, of which only the form was checked")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
