"""The pages of errors and notices, one an area, from the registry of messages and the snapshots of the tests."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

_MARK = "\n=== "


def write_error_pages(into: Path, messages: Path, shown: Path) -> None:
    """Write `into`/<area>.md for each registry file of `messages`; pages of areas that are gone are removed."""
    areas = {path.stem: tomllib.loads(path.read_text(encoding="utf-8")) for path in sorted(messages.glob("*.toml"))}
    for stale in into.glob("*.md"):
        if stale.stem not in (*areas, "index"):
            stale.unlink()
    for area, entries in areas.items():
        text, page = area_page(area, entries, _examples(shown / f"{area}.txt")), into / f"{area}.md"
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def area_page(area: str, entries: dict[str, Any], examples: dict[str, str]) -> str:
    """One section a code: explanation, example, fix. Each has its code as the target of links."""
    sections = (_section(f"{area}.{problem}", entry, examples) for problem, entry in sorted(entries.items()))
    return f"# {area}\n\n" + "\n".join(sections)


def _section(code: str, entry: dict[str, Any], examples: dict[str, str]) -> str:
    own = [text for name, text in examples.items() if name == code or name.removeprefix(f"{code}, ").isdecimal()]
    shown = "".join(f"```text\n{text}\n```\n\n" for text in own)
    return f"({code})=\n## `{code}`\n\n{entry['page'].strip()}\n\n{shown}**To fix it.** {entry['fix'].strip()}\n"


def _examples(path: Path) -> dict[str, str]:
    text = f"\n{path.read_text(encoding='utf-8')}" if path.exists() else ""
    sections = (part.partition("\n") for part in text.split(_MARK)[1:])
    return {name: message.strip("\n") for name, _, message in sections}
