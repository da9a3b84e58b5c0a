"""Every format of files: its reader exists, and messages, schemas and the guide list it."""

from __future__ import annotations

import inspect
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

from femtune.errors import FemtuneError
from femtune.files.formats import MATRIX_FORMATS, MODES_FORMATS, RECORD_FORMATS, FileFormat
from femtune.files.identification_file import IdentifyTable
from femtune.files.matrices.read import format_of
from femtune.files.records.read import format_named
from femtune.files.study_file import MatrixEntry, SolverTable

_DOCS = Path(__file__).resolve().parents[2] / "docs"
_ALL: list[FileFormat] = [*MATRIX_FORMATS, *MODES_FORMATS, *RECORD_FORMATS]


@pytest.mark.parametrize("format", _ALL, ids=lambda one: one.reader)
def test_the_reader_exists_and_takes_a_path(format: FileFormat) -> None:
    assert next(iter(inspect.signature(format.reader_function).parameters)) == "path"


@pytest.mark.parametrize(
    ("table", "formats"), [(MatrixEntry, MATRIX_FORMATS), (SolverTable, MODES_FORMATS), (IdentifyTable, RECORD_FORMATS)]
)
def test_a_study_may_name_every_format_and_no_other(table: Any, formats: Any) -> None:
    words = table.model_json_schema()["properties"]["format"]
    choices = words.get("enum") or next(choice["enum"] for choice in words["anyOf"] if "enum" in choice)
    assert tuple(choices) == formats.keys
    with pytest.raises(ValueError, match="format"):
        table.model_validate({"format": "no-such-format"})


def test_extensions_tell_formats_in_any_case(tmp_path: Path) -> None:
    for format in MATRIX_FORMATS:
        for suffix in format.suffixes:
            (tmp_path / f"a{suffix.upper()}").write_bytes(b"1 1 1.0\n")
            assert format_of(tmp_path / f"a{suffix.upper()}") == format.key
    for record_format in RECORD_FORMATS:
        for suffix in record_format.suffixes:
            assert format_named(Path(f"a{suffix.upper()}"), None) is record_format


def test_content_goes_before_the_extension(tmp_path: Path) -> None:
    signed = [one for one in MATRIX_FORMATS if one.signature]
    assert signed
    for format in signed:
        (tmp_path / "a.op4").write_bytes(format.signature.upper())
        assert format_of(tmp_path / "a.op4") == format.key


def test_messages_list_all_formats(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_bytes(b"")
    with pytest.raises(FemtuneError) as caught:
        format_of(tmp_path / "a.xyz")
    assert ", ".join(MATRIX_FORMATS.keys) in str(caught.value)
    with pytest.raises(FemtuneError) as caught:
        format_named(tmp_path / "a.xyz", None)
    assert ", ".join(RECORD_FORMATS.suffixes) in str(caught.value)


def test_a_study_is_checked_without_readers() -> None:
    code = "import sys, femtune.files.formats; print([m for m in ('numpy', 'scipy') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_tables_of_the_guide_are_those_of_the_formats() -> None:
    spec = spec_from_file_location("format_tables", _DOCS / "_ext" / "format_tables.py")
    assert spec is not None
    assert spec.loader is not None
    tables = module_from_spec(spec)
    spec.loader.exec_module(tables)
    shown = ""
    for name in tables.PAGES:
        text = (_DOCS / name).read_text(encoding="utf-8")
        assert tables.with_tables(text) == text, f"make docs writes the table of {name}"
        shown += text
    assert all(f"| `{format.key}` |" in shown for format in _ALL)
