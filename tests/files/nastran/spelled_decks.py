"""Decks whose values are known, spelled in all the ways that Nastran reads: three formats, exponents, continuations."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

Value = float | int | None


@dataclass
class SpelledDeck:
    """A deck and what it says: values of fields by name, and places of grid points."""

    text: str
    values: dict[str, float] = field(default_factory=dict)
    places: dict[int, tuple[float, float, float]] = field(default_factory=dict)


def spelled_deck(number: int) -> SpelledDeck:
    """A chain of bars with masses and springs; the same for a number in every run."""
    chance = random.Random(number)
    out = SpelledDeck("")
    lines: list[str] = []
    count = chance.randint(2, 5)
    for i in range(1, count + 1):
        x = (float(i), _real(chance, 2), _real(chance, 2))
        out.places[i] = x
        lines += _card(chance, "GRID", [i, None, *x])
    for name, id, fields in _properties(chance):
        lines += _card(chance, name, [id if v == "ID" else v for _, v in fields])
        out.values |= {f"{name} {id} {key}": float(v) for key, v in fields if key and isinstance(v, float)}
    for i in range(1, count):
        lines += _card(chance, "CBAR", [i, 3, i, i + 1, 0.0, 0.0, 1.0])
    mass = _real(chance, 3, positive=True)
    lines += _card(chance, "CONM2", [90, count, None, mass])
    out.values["CONM2 90 M"] = mass
    stiffness = _real(chance, 5, positive=True)
    lines += _card(chance, "CELAS2", [91, stiffness, count, 2])
    out.values["CELAS2 91 K"] = stiffness
    chance.shuffle(blocks := _blocks(lines))
    body = "".join(_dressed(chance, line) for block in blocks for line in block)
    out.text = f"SOL 103\nCEND\nSPC = 1\nBEGIN BULK\n{body}SPC1,1,123456,1\nENDDATA\n"
    return out


def _properties(chance: random.Random) -> list[tuple[str, int, list[tuple[str, Value | str]]]]:
    real = lambda decades: _real(chance, decades, positive=True)  # noqa: E731
    bar = [("", "ID"), ("", 2), *((n, real(4)) for n in ("A", "I1", "I2", "J", "NSM"))]
    return [
        ("MAT1", 2, [("", "ID"), ("E", real(9)), ("", None), ("NU", 0.25), ("RHO", real(3))]),
        ("PBAR", 3, [*bar, *[("", None)] * 9, ("K1", real(1)), ("K2", real(1))]),
    ]


def _real(chance: random.Random, decades: int, positive: bool = False) -> float:
    """A number of at most four digits, so that every spelling of it fits into a field of eight columns."""
    digits, exponent = chance.randint(1, 9999), chance.randint(-decades - 3, decades - 3)
    sign = "" if positive or chance.random() < 0.7 else "-"
    return float(f"{sign}{digits % 999 + 1 if sign else digits}e{exponent}")


def _spelling(chance: random.Random, value: Value, width: int) -> str:
    if value is None:
        return ""
    if isinstance(value, int):
        return str(value)
    mantissa, exponent = f"{value:.3e}".split("e")
    short, power = mantissa.rstrip("0"), int(exponent)
    sign = "+" if power >= 0 else "-"
    forms = [
        f"{short}{sign}{abs(power)}",
        f"{short}E{power}",
        f"{short}D{sign}{abs(power)}",
        f"{short}e{sign}{abs(power):02d}",
        f"+{short}{sign}{abs(power)}" if value > 0 else f"{short}{sign}{abs(power)}",
        f"{value:.9f}",
        f"{short}{sign}0{abs(power)}",
    ]
    if short.startswith("0.") and len(short) > 2:
        forms.append(short[1:] + f"{sign}{abs(power)}")
    good = [f for f in forms if len(f) <= width and float(_plain(f)) == value]
    return chance.choice(good or [f"{short}{sign}{abs(power)}"])


def _plain(text: str) -> str:
    """For this program's float."""
    text = text.upper().replace("D", "E")
    head, tail = text[:1], text[1:]
    for sign in "+-":
        if sign in tail and "E" not in tail:
            tail = tail.replace(sign, "E" + sign)
    return head + tail


def _card(chance: random.Random, name: str, fields: list[Value]) -> list[str]:
    """Lines of a card in small, large or free field."""
    kind = chance.choice(("small", "large", "free"))
    width = 16 if kind == "large" else 8
    texts = [_spelling(chance, v, width) for v in fields]
    per = 4 if kind == "large" else 8
    rows = [texts[i : i + per] for i in range(0, len(texts), per)]
    if kind == "free":
        space = chance.choice(("", " "))
        heads = [name, *[chance.choice(("", "+"))] * (len(rows) - 1)]
        return [head + "," + ",".join(space + t for t in row) for head, row in zip(heads, rows)]
    out = []
    for k, row in enumerate(rows):
        # a line of blanks alone is no continuation
        mark = "*" if kind == "large" else chance.choice(("", "+")) if any(row) else "+"
        head = name + ("*" if kind == "large" else "") if k == 0 else mark
        justify = str.ljust if chance.random() < 0.5 else str.rjust
        out.append((head.ljust(8) + "".join(justify(t, width) for t in row)).rstrip())
    return out


def _blocks(lines: list[str]) -> list[list[str]]:
    """Cards with their continuations."""
    out: list[list[str]] = []
    for line in lines:
        if line[:1].isalpha():
            out.append([])
        out[-1].append(line)
    return out


def _dressed(chance: random.Random, line: str) -> str:
    """With a comment, in lower case, or as it is."""
    if chance.random() < 0.15:
        line = line.lower()
    if chance.random() < 0.1 and len(line) < 60:
        line += " $ a comment, 1.0"
    return line + "\n"
