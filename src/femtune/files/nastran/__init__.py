"""Nastran bulk data decks: read and written back line by line."""

from __future__ import annotations

from femtune.files.nastran.card import Card
from femtune.files.nastran.case_control import CaseCommand, CaseControl
from femtune.files.nastran.deck import Deck, DeckParameter, Executive, read_deck
from femtune.files.nastran.edit import EditedDeck, FieldChange, NewCard, edit_fields
from femtune.files.nastran.lists import IntegerList, Span, read_list
from femtune.files.nastran.reals import format_real, parse_integer, parse_real, rounded
from femtune.files.nastran.write import IncludeChange, WrittenDeck, write_deck

__all__ = [
    "Card",
    "CaseCommand",
    "CaseControl",
    "Deck",
    "DeckParameter",
    "EditedDeck",
    "Executive",
    "FieldChange",
    "IncludeChange",
    "IntegerList",
    "NewCard",
    "Span",
    "WrittenDeck",
    "edit_fields",
    "format_real",
    "parse_integer",
    "parse_real",
    "read_deck",
    "read_list",
    "rounded",
    "write_deck",
]
