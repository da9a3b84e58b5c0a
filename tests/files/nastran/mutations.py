"""Decks changed at random, as files in the world are: by a bad transfer, an editor, or another program.

The mutations of a number are the same in every run.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Mapping

Files = Mapping[str, bytes]
Lines = list[bytes]

ODD = (b"", b"0", b"-1", b"1", b"2", b"7", b"99", b"1.", b"-1.", b"0.", b".5", b"1.5-3", b"1.+30", b"-1.+30",
       b"1.+60", b"1.+90", b"1.+300", b"1.-300", b"1.e400", b"NaN", b"INF", b"1.5.2", b"123", b"123456", b"1234567",
       b"3.-", b"999999999", b"99999999999999999999", b"-7", b"THRU", b"BY", b"ALL", b"YES", b"K", b"GE", b"UM",
       b"ALPHA", b"*(1)", b"=", b"==", b"'<b>'", b"$", b"+A", b"\xe9")  # fmt: skip
BYTES = b" ,+*=$\n\r\t\"'A1.-(\xe9\x00\xff\x1b0E"
CARDS = (b"GRID", b"CBAR", b"CBEAM", b"CQUAD4", b"CTRIA3", b"CQUAD8", b"CTRIA6", b"PBAR", b"PBARL", b"PBEAM", b"PSHELL",
         b"PBUSH", b"MAT1",
         b"MAT8", b"CONM2", b"CONM1", b"RBE2", b"RBE3", b"RBE1", b"MPC", b"SPC1", b"SPC", b"CELAS2", b"CHEXA", b"NSM1",
         b"CPENTA", b"CSHEAR", b"PSOLID", b"MAT9", b"PCOMP", b"PCOMPG",
         b"XYZ", b"DMIG", b"INCLUDE", b"ENDDATA", b"BEGIN", b"TABDMP1", b"SPOINT", b"ASET1", b"PARAM")  # fmt: skip
_END = b"\r\n"


def mutant(files: Files, number: int) -> dict[str, bytes]:
    """The files with one to four changes."""
    chance = random.Random(number)
    out = dict(files)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 4))):
        name = chance.choice(list(out))
        out[name] = chance.choice(_MUTATIONS)(out[name], chance)
    return out


def _on_lines(change: Callable[[Lines, random.Random], None]) -> Callable[[bytes, random.Random], bytes]:
    def changed(text: bytes, chance: random.Random) -> bytes:
        lines = text.splitlines(keepends=True)
        if lines:
            change(lines, chance)
        return b"".join(lines)

    return changed


def _flip(text: bytes, chance: random.Random) -> bytes:
    raw = bytearray(text or b" ")
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(raw))
        raw[at] = chance.choice(BYTES) if chance.random() < 0.8 else raw[at] ^ (1 << chance.randrange(8))
    return bytes(raw)


def _insert(text: bytes, chance: random.Random) -> bytes:
    at = chance.randint(0, len(text))
    return text[:at] + bytes([chance.choice(BYTES)]) + text[at + chance.randint(0, 1) :]


def _cut(text: bytes, chance: random.Random) -> bytes:
    return text[: chance.randint(0, len(text))]


def _delete(lines: Lines, chance: random.Random) -> None:
    at = chance.randrange(len(lines))
    del lines[at : at + chance.choice((1, 1, 1, 2, 5))]


def _duplicate(lines: Lines, chance: random.Random) -> None:
    lines.insert(chance.randint(0, len(lines)), chance.choice(lines))


def _swap(lines: Lines, chance: random.Random) -> None:
    a, b = chance.randrange(len(lines)), chance.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]


def _field(lines: Lines, chance: random.Random) -> None:
    at = chance.randrange(len(lines))
    lines[at] = _with_field(lines[at], chance.choice(ODD), chance)


def _same_kind(lines: Lines, chance: random.Random) -> None:
    """A number becomes another one of its kind, so that the card is still read."""
    at = chance.randrange(len(lines))
    content = lines[at].rstrip(_END)
    found = list(_NUMBER.finditer(content, min(len(content), 6)))
    if not found:
        return
    old = chance.choice(found)
    new = chance.choice(_REALS if b"." in old[0] else _INTEGERS)
    room = len(old[0]) if b"," in content else max(len(old[0]), 8)
    blank = content[old.end() :][: room - len(old[0])]
    kept = content[old.end() + (room - len(old[0]) if not blank.strip() else 0) :]
    lines[at] = content[: old.start()] + new.ljust(room) + kept + lines[at][len(content) :]


_REALS = (b"0.", b"-1.", b"1.", b".5", b"-.3", b"1.-9", b"1.-30", b"1.+12", b"1.+29", b"1.+59", b"-1.+59", b"1.+200")
_INTEGERS = (b"0", b"1", b"2", b"3", b"4", b"5", b"7", b"10", b"11", b"13", b"-1", b"456", b"123456", b"99999999")
_NUMBER = re.compile(rb"(?<![A-Z0-9.+-])[+-]?(?:\d+\.?\d*|\.\d+)(?:[+-]\d+)?(?![A-Z0-9])", re.IGNORECASE)


def _copied_field(lines: Lines, chance: random.Random) -> None:
    at, other = chance.randrange(len(lines)), chance.randrange(len(lines))
    words = lines[other].replace(b",", b" ").split() or [b""]
    lines[at] = _with_field(lines[at], chance.choice(words), chance)


def _with_field(line: bytes, value: bytes, chance: random.Random) -> bytes:
    content = line.rstrip(_END)
    if b"," in content:
        pieces = content.split(b",")
        pieces[chance.randrange(len(pieces))] = value
        return b",".join(pieces) + line[len(content) :]
    width = 16 if b"*" in content[:8] else 8
    start = 8 + width * chance.randrange(64 // width)
    padded = content.ljust(80)
    return (padded[:start] + value.ljust(width)[:width] + padded[start + width :]).rstrip() + line[len(content) :]


def _card_name(lines: Lines, chance: random.Random) -> None:
    at = chance.randrange(len(lines))
    name = chance.choice(CARDS)
    lines[at] = name + b"," + lines[at].partition(b",")[2] if b"," in lines[at] else name.ljust(8) + lines[at][8:]


def _free(lines: Lines, chance: random.Random) -> None:
    """A line in columns becomes one with commas."""
    at = chance.randrange(len(lines))
    body = lines[at].rstrip(_END)
    pieces = [body[i : i + 8].strip() for i in range(0, 72, 8)]
    lines[at] = b",".join(pieces).rstrip(b",") + lines[at][len(body) :]


def _large(lines: Lines, chance: random.Random) -> None:
    at = chance.randrange(len(lines))
    lines[at] = lines[at][:8].rstrip()[:7] + b"*" + lines[at][8:]


def _tabs(lines: Lines, chance: random.Random) -> None:
    at = chance.randrange(len(lines))
    lines[at] = lines[at].replace(b"  ", b"\t", chance.randint(1, 4))


def _include(lines: Lines, chance: random.Random) -> None:
    if chance.random() < 0.5:
        return
    target = chance.choice((b"deck.bdf", b"more.inc", b"nothing.bdf", b".", b"./deck.bdf", b"\xe9", b"a" * 300))
    quote = chance.choice((b"'", b'"', b""))
    lines.insert(chance.randint(0, len(lines)), b"INCLUDE " + quote + target + chance.choice((quote, b"")) + b"\n")


def _line_endings(text: bytes, chance: random.Random) -> bytes:
    return text.replace(b"\n", chance.choice((b"\r\n", b"\r", b"\n\n", b" \n")), chance.choice((-1, 5)))


def _case(text: bytes, chance: random.Random) -> bytes:
    return text.lower() if chance.random() < 0.5 else text.swapcase()


_LINE_MUTATIONS = (_delete, _duplicate, _swap, _card_name, _free, _large, _tabs, _copied_field)
_MUTATIONS = (
    _flip,
    _insert,
    _cut,
    _line_endings,
    _case,
    *map(_on_lines, (*_LINE_MUTATIONS, _include, *[_field] * 5, *[_same_kind] * 9)),
)
