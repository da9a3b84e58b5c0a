"""The text of a first study: keys, with the reasons for their values as comments."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

_LINE_WIDTH = 112
"""Characters in a line of comments; they stay readable in an editor without wrapping."""


@dataclass
class StudyText:
    """Lines of a TOML file as they are put together."""

    lines: list[str] = field(default_factory=list)

    def say(self, *sentences: str, indent: str = "") -> None:
        """Comments; each sentence begins a new line."""
        for sentence in sentences:
            first, rest = f"# {indent}", f"# {' ' * len(indent)}"
            self.lines += textwrap.wrap(
                sentence, _LINE_WIDTH, initial_indent=first, subsequent_indent=rest, break_long_words=False
            )

    def listed(self, sentences: Iterable[str]) -> None:
        """Comments as a list."""
        for sentence in sentences:
            self.say(sentence, indent="- ")

    def table(self, name: str) -> None:
        """A new table."""
        self.lines += ["", name]

    def key(self, name: str, value: Any, remark: str = "") -> None:
        """A key with its value."""
        line = f"{name} = {toml(value)}"
        self.lines.append(f"{line}    # {remark}" if remark else line)

    def off(self, lines: Sequence[str]) -> None:
        """Lines that are switched off."""
        self.lines += [f"# {line}".rstrip() for line in lines]

    @property
    def text(self) -> str:
        """All of it."""
        return "\n".join(self.lines).strip() + "\n"


def toml(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{name} = {toml(part)}' for name, part in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    return repr(value)
