"""What the program says is held against snapshots, `shown/<area>.txt`; the error pages show the same texts.

After a message was reworded in the registry, `FEMTUNE_SHOWN=write pytest -n 0 tests` writes the snapshots again. Read
the difference before it is committed.
"""

from __future__ import annotations

import os
from pathlib import Path

_FOLDER = Path(__file__).parent / "shown"
_MARK = "=== "


def shown_messages(area: str) -> dict[str, str]:
    """The snapshots of an area by name: a code, or a code and what tells its examples apart after a comma."""
    path = _FOLDER / f"{area}.txt"
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    sections = (part.partition("\n") for part in f"\n{text}".split(f"\n{_MARK}")[1:])
    return {name: message.rstrip("\n") for name, _, message in sections}


def shown_areas() -> list[str]:
    """The areas that have snapshots."""
    return sorted(path.stem for path in _FOLDER.glob("*.txt"))


def check_shown(name: str, message: object) -> None:
    """Hold a message against its snapshot; write the snapshot where FEMTUNE_SHOWN is "write".

    Parameters
    ----------
    name : ``area.problem``, or ``area.problem, what tells it apart``
    message : the error or notice, or its text
    """
    area = name.partition(".")[0]
    assert name.partition(",")[0] in str(message).partition("\n")[0], "the message has another code than its snapshot"
    assert f"{os.sep}test_" not in str(message), "the folder of a test is another one in each run"
    if os.environ.get("FEMTUNE_SHOWN") == "write":
        _write(area, {**shown_messages(area), name: str(message).rstrip("\n")})
    assert shown_messages(area).get(name) == str(message).rstrip("\n")


def _write(area: str, messages: dict[str, str]) -> None:
    text = "\n\n".join(f"{_MARK}{name}\n{messages[name]}" for name in sorted(messages))
    (_FOLDER / f"{area}.txt").write_text(f"{text}\n", encoding="utf-8")
