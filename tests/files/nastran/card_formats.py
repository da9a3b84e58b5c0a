"""Cards written in every format, with the place of each field among the characters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

Pieces = list[tuple[str, int | None]]
COMMENTS = {"none": "", "near": " $ kept, 1.5 caf\u00e9", "far": "$ kept, 1.5 caf\u00e9"}


@dataclass
class Written:
    """Text of a card; `spans` are the characters of each field that has a place, `end` follows its last line's text.

    A field that lies behind the text of its line has the blanks there, if any; `exact` are the fields in columns.
    """

    text: str = ""
    spans: dict[int, tuple[int, int]] = field(default_factory=dict)
    exact: set[int] = field(default_factory=set)
    end: int = 0


def _rows(name: str, texts: Sequence[str], count: int, at: int = 0) -> list[list[tuple[str, int]]]:
    numbered = list(zip(texts, range(at, at + len(texts))))
    return [numbered[i : i + count] for i in range(0, len(numbered), count)] or [[]]


def _open_end(row: Sequence[object], i: int, count: int) -> list[tuple[str, int]]:
    """Fields behind the last one of a line: they have a place, but no characters."""
    return [("", count * i + j) for j in range(len(row), count)]


def _columns(
    heads: Callable[[str, int], str], width: int, left: bool, tails: bool = False
) -> Callable[..., list[Pieces]]:
    """Lines in columns; `heads` gives field 1, `tails` names continuations in field 10."""

    def lines(name: str, texts: Sequence[str], last: bool = True) -> list[Pieces]:
        rows = _rows(name, texts, 64 // width)
        if width == 16 and len(rows) % 2:
            rows.append([])
        made = []
        for i, row in enumerate(rows):
            more = tails and i + 1 < len(rows)
            head = heads(name, i)
            head = "+" if not head and not any(t for t, _ in row) else head
            whole = [*row, *_open_end(row, i, 64 // width)]
            body: Pieces = [(t.ljust(width) if left else t.rjust(width), k) for t, k in whole]
            tail: Pieces = [(("*" if width == 16 else "+") + f"C{i + 1}", None)] if more else []
            made.append([(head.ljust(8), None), *body, *tail])
        return made

    return lines


def _tabbed(head: str) -> str:
    """Field 1; a tab behind eight characters would leave the next field out."""
    return head if len(head) == 8 else head + "\t"


def _tabs(name: str, texts: Sequence[str]) -> list[Pieces]:
    return [
        [(_tabbed(name if i == 0 else "+"), None), *((t + "\t", k) for t, k in row), *_open_end(row, i, 8)]
        for i, row in enumerate(_rows(name, texts, 8))
    ]  # fmt: skip


def _large_tabs(name: str, texts: Sequence[str]) -> list[Pieces]:
    rows = _rows(name, texts, 4)
    rows += [[]] * (len(rows) % 2)
    return [
        [(_tabbed((name if i == 0 else "") + "*"), None), *((t + "\t\t", k) for t, k in row), *_open_end(row, i, 4)]
        for i, row in enumerate(rows)
    ]


def _free(
    count: int, heads: Callable[[str, int], str], blank: str = "", tails: bool = False
) -> Callable[..., list[Pieces]]:
    """Lines with commas, blanks around the fields if any."""

    def lines(name: str, texts: Sequence[str]) -> list[Pieces]:
        rows = _rows(name, texts, count)
        made = []
        for i, row in enumerate(rows):
            more = tails and i + 1 < len(rows)
            pieces: Pieces = [(heads(name, i), None)]
            for text, k in [*row, *_open_end(row, i, count)] if more else row:
                pieces += [("," + blank, None), (text + blank, k)] if text else [(",", None), (2 * blank, k)]
            made.append([*pieces, (f",+C{i + 1}", None)] if more else [*pieces, *_open_end(row, i, count)])
        return made

    return lines


def _mixed(name: str, texts: Sequence[str]) -> list[Pieces]:
    """The first line in small field, the others in large field."""
    first = FORMATS["small"](name, texts[:8])
    rest = FORMATS["large"](name, texts[8:]) if len(texts) > 8 else []
    shifted = [[(t, None if k is None else k + 8) for t, k in line] for line in rest]
    return [*first, *([("*".ljust(8), None), *line[1:]] for line in shifted)]


def _named(name: str, i: int) -> str:
    return f"+C{i}" if i else name


FORMATS: dict[str, Callable[..., list[Pieces]]] = {
    "small": _columns(lambda name, i: "+" if i else name, 8, False),
    "small-blank": _columns(lambda name, i: "" if i else name, 8, True),
    "small-named": _columns(_named, 8, False, True),
    "tabs": _tabs,
    "large": _columns(lambda name, i: "*" if i else name + "*", 16, False),
    "large-named": _columns(lambda name, i: f"*C{i}" if i else name + "*", 16, True, True),
    "large-tabs": _large_tabs,
    "free": _free(8, lambda name, i: "" if i else name),
    "free-blanks": _free(8, lambda name, i: "+ " if i else name + " ", " "),
    "free-named": _free(8, _named, "", True),
    "free-large": _free(4, lambda name, i: "*" if i else name + "*"),
    "mixed": _mixed,
}
FREE = frozenset(name for name in FORMATS if name.startswith("free"))


def write_card(form: str, name: str, texts: Sequence[str], comment: str, ending: str) -> Written:
    """A card, each line with a comment, and comment lines between; the last line has no ending."""
    out = Written()
    lines = FORMATS[form](name, texts)
    columns = form not in FREE and "tabs" not in form
    for i, pieces in enumerate(lines):
        far = comment == "far" and columns
        _write_line(out, pieces, far, len(COMMENTS[comment]) - len(COMMENTS[comment].lstrip()), columns)
        out.text += COMMENTS[comment]
        out.end = len(out.text)
        if i + 1 < len(lines):
            out.text += ending + (f"$ between, 7.5{ending}" if comment != "none" else "")
    return out


def _write_line(out: Written, pieces: Pieces, far: bool, comment_blanks: int, columns: bool) -> None:
    body = "".join(text for text, _ in pieces)
    near = 0 if far else comment_blanks
    kept = body.ljust(80) if far else body.rstrip(" \t" if "," not in body else " ")
    start = len(out.text)
    out.text += kept
    at = 0
    for text, k in pieces:
        first, last = min(at, len(kept)), min(at + len(text), len(kept))
        at += len(text)
        if k is None:
            continue
        whole = last - first == len(text) and (far or last < len(kept.rstrip()))
        # blanks before a comment belong to the last field
        out.spans[k] = (start + first, start + last if whole else start + len(kept) + near)
        if columns and whole:
            out.exact.add(k)
