"""The text of a study file: where its keys stand, and how they are named in messages."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from femtune.errors import FemtuneError, Where
from femtune.files.study_file.lines import Place


@dataclass(frozen=True)
class Source:
    """Name of the study file and the line of every place in it; `page` of the documentation explains its keys."""

    file: str
    lines: dict[Place, int] = field(default_factory=dict)
    page: str = "docs/study-file.md"

    def where(self, place: Place) -> Where:
        """The place itself, or the innermost table around it that the file has."""
        for length in range(len(place), 0, -1):
            if place[:length] in self.lines:
                return Where(self.file, self.lines[place[:length]], dotted(place))
        return Where(self.file, None, dotted(place))

    def error(self, place: Place, code: str, what: str, values: dict[str, Any], hint: str) -> FemtuneError:
        """An error at a place of this file; values are shown as TOML spells them."""
        shown = {name: spelled(value) for name, value in values.items()}
        return FemtuneError(code, what, where=self.where(place), values=shown, hint=hint)


def dotted(place: Place) -> str:
    """``parameter[2].lower``: the key `lower` of the second [[parameter]]."""
    parts = [f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in place]
    return "".join(parts).removeprefix(".")


def spelled(value: object, longest: int = 300) -> str:
    """A value as TOML spells it, cut where it is long."""
    if isinstance(value, dict):
        text = "{ " + ", ".join(f"{k} = {spelled(v)}" for k, v in list(value.items())[:20]) + " }"
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(spelled(v) for v in value[:20]) + "]"
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, int) and abs(value) >= 10**longest:
        text = f"an integer of {value.bit_length()} bits"
    else:
        text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= longest else text[: longest - 1] + "…"
