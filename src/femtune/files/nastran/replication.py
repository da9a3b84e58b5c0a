"""Replication: a line that starts with ``=`` repeats the card above with some fields changed.

``=`` in a data field repeats that field, ``==`` that field and all after it, ``*(i)`` adds i to it; ``=(n)`` or
``=n`` in the first field makes n more cards in the same way.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.card import Card
from femtune.files.nastran.fields import FieldLine, split_line
from femtune.files.nastran.reals import format_real, parse_integer, parse_real

_HEAD = re.compile(r"=(?:\(?(\d{1,5})\)?)?")
_INCREMENT = re.compile(r"\*\(?([^()*]+)\)?")


def is_replication(cut: FieldLine) -> bool:
    """Whether a line repeats the card above."""
    return cut.head.startswith("=")


def replicate(cards: Sequence[Card], cut: FieldLine, superelement: int) -> list[Card]:
    """Cards that the replication line makes.

    Raises
    ------
    FemtuneError : ``deck.replication``
    """
    head = _HEAD.fullmatch(cut.head)
    if head is None or not cards:
        raise _error(cut, "this replication line cannot be followed" if cards else "no card stands above it")
    parent = cards[-1]
    if len(parent.lines) > 1:
        raise _error(cut, "replication of a card with continuations is not read")
    count, rule = int(head[1] or 1), cut
    if head[1] and not any(cut.data):
        rule = _rule_above(parent, cut)
    made = [parent]
    for _ in range(count):
        made.append(_next(made[-1], rule, cut, len(cards) + len(made) - 1, superelement))
    return made[1:]


def _rule_above(parent: Card, cut: FieldLine) -> FieldLine:
    if not parent.replicated:
        raise _error(cut, "no replication line stands above that says how to go on")
    rule = parent.lines[0]
    return split_line(rule, rule.body)


def _next(previous: Card, rule: FieldLine, cut: FieldLine, position: int, superelement: int) -> Card:
    before = [*previous.fields, *[""] * (8 - len(previous.fields))]
    fields: list[str] = []
    for index, text in enumerate(rule.data):
        if text == "==":
            fields += before[index:]
            break
        fields.append(_field(before[index], text, cut))
    while fields and not fields[-1]:
        fields.pop()
    card = replace(previous, given=tuple(fields), lines=(cut.source,), position=position, plain=False)
    return replace(card, replicated=True, superelement=superelement, format=cut.format)


def _field(before: str, text: str, cut: FieldLine) -> str:
    if text == "=":
        return before
    increment = _INCREMENT.fullmatch(text)
    return _sum(before, increment[1], cut) if increment else text


def _sum(before: str, step: str, cut: FieldLine) -> str:
    whole, whole_step = parse_integer(before), parse_integer(step)
    if whole is not None and whole_step is not None:
        return str(whole + whole_step)
    real, real_step = parse_real(before), parse_real(step)
    if real is None or real_step is None:
        raise _error(cut, f"'{step}' cannot be added to '{before}'")
    return format_real(float(Decimal(repr(real)) + Decimal(repr(real_step))), 16)


def _error(cut: FieldLine, what: str) -> FemtuneError:
    where = Where(cut.source.file, cut.source.number, cut.head)
    return FemtuneError("deck.replication", what, where=where, hint="write these cards out")
