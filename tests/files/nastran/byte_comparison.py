"""A deck on the disk around a card of `card_formats`, and its files compared byte by byte with what was written."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from femtune.files.nastran import WritePlan, parse_real

from .card_formats import Written, write_card
from .card_samples import Sample

ENDINGS = {"lf": ("\n", "\n"), "crlf": ("\r\n", "\r\n"), "lf-open": ("\n", ""), "crlf-open": ("\r\n", "")}
PLACES = {"main": (), "include": ("parts/a.inc",), "nested": ("parts/a.inc", "../far/b.inc")}
CHANGED = rb"[ ,\t0-9.+\-]*"
NEW_LINES = rb"(?:\r?\n[+*][ ,\t0-9.+\-*A-Za-z]*)*"


@dataclass(frozen=True)
class Variant:
    """How a deck is written, apart from its card."""

    form: str
    ending: str
    comment: str
    place: str
    lower: bool

    def __str__(self) -> str:
        return "-".join([self.form, self.ending, self.comment, self.place, "lower" if self.lower else "upper"])


@dataclass(frozen=True)
class WrittenDeck:
    """The deck of a sample on the disk: bytes of each file, and of the file of the card what stands before it."""

    files: dict[Path, bytes]
    target: Path
    start: int
    card: Written

    @property
    def main(self) -> Path:
        """The main file."""
        return next(iter(self.files))


def lay_out(sample: Sample, texts: Sequence[str], variant: Variant, folder: Path) -> WrittenDeck:
    """The deck's files; the sample's card stands last in its file, behind a line of text that is a comment."""
    newline, end = ENDINGS[variant.ending]
    card = write_card(variant.form, sample.card, texts, variant.comment, newline)
    if variant.lower:
        card = replace(card, text=card.text.lower())
    context = [line.lower() if variant.lower else line for line in sample.context]
    paths = [folder / "deck.bdf"]
    contents = [newline.join([*context, ""])]
    for written in PLACES[variant.place]:
        contents[-1] += f"INCLUDE '{written}'{newline}"
        paths.append((paths[-1].parent / written).resolve())
        contents.append("$ caf\u00e9" + newline)
    start = len(contents[-1])
    contents[-1] += card.text + end
    files = {path: text.encode("latin-1") for path, text in zip(paths, contents)}
    for path, content in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return WrittenDeck(files, paths[-1], start, card)


def check_bytes(deck: WrittenDeck, plan: WritePlan, indices: Sequence[int], value: float) -> None:
    """The file of the card with other characters in the fields, and no other change; no other file changes."""
    texts = plan.edited.texts
    old = deck.files[deck.target]
    same = parse_real(texts_at(deck, indices[0]).strip(" ,\t").upper()) == value
    if same and len(indices) == 1:
        assert texts == {}
        return
    assert list(texts) == [str(deck.target)]
    new = texts[str(deck.target)].encode("latin-1")
    head, tail = old[: deck.start], old[deck.start + deck.card.end :]
    assert new.startswith(head)
    assert new.endswith(tail)
    card = new[len(head) : len(new) - len(tail)]
    match = re.fullmatch(pattern(deck, indices), card, re.DOTALL)
    assert match, (old[deck.start :], card)
    for text in match.groups()[:-1]:
        found = parse_real(text.strip(b" ,\t").decode())
        assert found == value


def texts_at(deck: WrittenDeck, index: int) -> str:
    first, last = deck.card.spans.get(index, (0, 0))
    return deck.card.text[first:last]


def pattern(deck: WrittenDeck, indices: Sequence[int]) -> bytes:
    """The old card as an expression in which the fields, and lines behind it where there are none, are open."""
    card = deck.files[deck.target][deck.start :]
    out, at = b"", 0
    for first, last, width in _spans(deck, indices):
        out += re.escape(card[at:first]) + b"(" + (CHANGED if width is None else rb"[ 0-9.+\-]{%d}" % width) + b")"
        at = last
    beyond = any(i not in deck.card.spans for i in indices)
    return out + re.escape(card[at : deck.card.end]) + b"(" + (NEW_LINES if beyond else b"") + b")"


def _spans(deck: WrittenDeck, indices: Sequence[int]) -> list[tuple[int, int, int | None]]:
    """First and last character of each field and its width, None where it may grow."""
    card = deck.card
    known = sorted((*card.spans[i], i) for i in indices if i in card.spans)
    return [(first, last, last - first if i in card.exact else None) for first, last, i in known]


def line_of(deck: WrittenDeck, index: int) -> int:
    """Number of the line of a field; of the card's last one for a field behind it."""
    at = deck.start + deck.card.spans.get(index, (deck.card.end, 0))[0]
    return deck.files[deck.target][:at].count(b"\n") + 1
