"""The registry of messages: every code is explained, every template can be filled, every snapshot has its wording."""

from __future__ import annotations

import re
import string
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.messages.shown import shown_areas, shown_messages

import femtune
from femtune.errors import FemtuneError, wording

_REGISTRY = {
    path.stem: tomllib.loads(path.read_text(encoding="utf-8"))
    for path in sorted((Path(femtune.__file__).parent / "messages").glob("*.toml"))
}
_ENTRIES = {f"{area}.{problem}": entry for area, problems in _REGISTRY.items() for problem, entry in problems.items()}
_NAME = re.compile(r"[a-z][a-z0-9-]*\.[a-z][a-z0-9-]*")
_FIELD = re.compile(r"[a-z][a-z0-9_]*(\.[a-z_]+|\[\d\])*")
_TEXTS = ("what", "hint", "page", "fix")


class _AnyFact:
    """A fact that any template can show."""

    def __format__(self, spec: str) -> str:
        return "…"

    def __getattr__(self, name: str) -> _AnyFact:
        return self

    def __getitem__(self, key: object) -> _AnyFact:
        return self


class _AllFacts(dict[str, _AnyFact]):
    def __missing__(self, key: str) -> _AnyFact:
        return _AnyFact()


def _wordings(entry: dict[str, Any]) -> Iterator[dict[str, str]]:
    """The wording of a code and those of its variants."""
    yield from (one for one in (entry, *(v for v in entry.values() if isinstance(v, dict))) if "what" in one)


def _templates() -> Iterator[tuple[str, str]]:
    for code, entry in _ENTRIES.items():
        for one in _wordings(entry):
            yield from ((code, one[key]) for key in ("what", "hint") if key in one)


def _pattern(template: str) -> str:
    parts = string.Formatter().parse(template)
    return "".join(re.escape(text) + ("" if field is None else r"[\s\S]*?") for text, field, *_ in parts)


# All codes are checked in one test: as a test each they would take more time than what they check.


def test_every_code_is_explained() -> None:
    for code, entry in _ENTRIES.items():
        assert _NAME.fullmatch(code), code
        assert entry["page"].strip(), code
        assert entry["fix"].strip(), code
        assert all(isinstance(value, dict) or key in _TEXTS for key, value in entry.items()), code
        assert list(_wordings(entry)), code
        assert all(set(v) <= {"what", "hint"} and v["what"] for v in entry.values() if isinstance(v, dict)), code


def test_templates_can_be_filled_and_name_plain_facts() -> None:
    for code, template in _templates():
        assert template.format_map(_AllFacts()), code
        fields = [field for _, field, *_ in string.Formatter().parse(template) if field is not None]
        assert all(_FIELD.fullmatch(field) for field in fields), (code, fields)


def test_an_unknown_code_is_a_mistake_of_the_program() -> None:
    with pytest.raises(KeyError):
        FemtuneError("deck.no-such-problem")
    with pytest.raises(KeyError):
        wording("deck.list/no-such-variant")


@pytest.mark.parametrize("area", shown_areas())
def test_what_is_shown_has_the_wording_of_the_registry(area: str) -> None:
    for name, text in shown_messages(area).items():
        code = name.partition(",")[0]
        # a study names the key before what its own checks say
        said = [rf"\[{code}\] (.*: )?{_pattern(one['what'])}(\n| at |$)" for one in _wordings(_ENTRIES[code])]
        assert any(re.match(pattern, text) for pattern in said), text


def test_every_code_has_an_example() -> None:
    shown = {name.partition(",")[0] for area in shown_areas() for name in shown_messages(area)}
    assert [code for code in _ENTRIES if code not in shown] == []


def test_the_index_names_every_area() -> None:
    index = (Path(__file__).resolve().parents[1] / "docs" / "errors" / "index.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| \[([a-z]+)\]\(\1\.md\) \|", index, re.MULTILINE)) == sorted(_REGISTRY)
