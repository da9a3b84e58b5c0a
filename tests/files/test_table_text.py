"""Lines and cells of tables of text."""

from __future__ import annotations

from pathlib import Path

import pytest

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.masses_table import read_masses_table
from femtune.files.repeats_table import read_repeats_table
from femtune.files.runs_table import read_runs_table
from femtune.files.table_text import NotATable, TableText, read_table_text


def read(folder: Path, content: bytes) -> TableText:
    (folder / "table.csv").write_bytes(content)
    return read_table_text(folder / "table.csv")


@pytest.mark.parametrize(
    ("content", "lines", "rows"),
    [
        (b'a,b\r\n1,"x, ""y"""\r2,z\n', (1, 2, 3), (("a", "b"), ("1", 'x, "y"'), ("2", "z"))),
        (b"a;b\n1;2\n;\n ; \n3;4\n;\n", (1, 2, 5), (("a", "b"), ("1", "2"), ("3", "4"))),
        (b";;\na;b\n1;2\n", (2, 3), (("a", "b"), ("1", "2"))),
        (b"a,b\r\n1,2\r\n\x1a", (1, 2), (("a", "b"), ("1", "2"))),
        ("a,b\nx\u2028y\x0c\u0085z,2\n".encode(), (1, 2), (("a", "b"), ("x\u2028y\x0c\u0085z", "2"))),
    ],
)
def test_lines_and_cells(content: bytes, lines: tuple[int, ...], rows: tuple[object, ...], tmp_path: Path) -> None:
    found = read(tmp_path, content)
    assert (found.lines, found.rows) == (lines, rows)


@pytest.mark.parametrize(
    ("content", "says", "line"),
    [
        (b'a,b,c\n\n1,0.1,"foo\n', "not closed in the line; a cell cannot contain a line break", 3),
        (b'a,b\n1,"2,3\n4,5\n', "not closed", 2),
        (b'a,b\n1,"2"3\n', "expected after", 2),
        (b"a,b\n1,\x1b\n", "binary file", None),
        (b"a,b\n1,\x1a2\n", "binary file", None),
        (b"a,b\n1,\xfc\n", "UTF-8", None),
    ],
)
def test_what_is_no_table(content: bytes, says: str, line: int | None, tmp_path: Path) -> None:
    with pytest.raises(NotATable, match=says) as caught:
        read(tmp_path, content)
    assert caught.value.line == line


@pytest.mark.parametrize(
    ("reader", "heading"),
    [
        (lambda path: read_masses_table(path, 1.0), "node;mass"),
        (read_repeats_table, "a;b"),
        (read_runs_table, "E;f1_hz"),
    ],
)
def test_a_message_quotes_the_cell_as_it_is_in_the_file(reader, heading: str, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(f"{heading}\n1;2\n1;2,25,1\n")
    with pytest.raises(FemtuneError, match="'2,25,1'") as caught:
        reader(tmp_path / "table.csv")
    assert caught.value.where is not None
    assert caught.value.where.line == 3
    (tmp_path / "table.csv").write_text(f'{heading}\n1;2\n1;"2\n')
    with pytest.raises(FemtuneError, match="not closed") as caught:
        reader(tmp_path / "table.csv")
    assert caught.value.where is not None
    assert caught.value.where.line == 3


def test_a_table_of_runs_with_many_wrong_cells(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text("E,f1_hz\n1,2\n" + "x,1\n" * 19 + "1,x\n" * 20)
    with pytest.raises(FemtuneErrors) as caught:
        read_runs_table(tmp_path / "runs.csv")
    assert len(caught.value.errors) == 20
    assert "more lines may be wrong" in caught.value.errors[-1].hint
