"""Nastran bulk data decks: read, turned into structures, and written back line by line."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.files.nastran.build import BuiltDeck, build_structure
    from femtune.files.nastran.card import Card
    from femtune.files.nastran.case_control import CaseCommand, CaseControl
    from femtune.files.nastran.deck import Deck, DeckParameter, Executive, read_deck
    from femtune.files.nastran.edit import EditedDeck, FieldChange, NewCard, edit_fields
    from femtune.files.nastran.field_refs import parse_field_ref, resolve
    from femtune.files.nastran.lines import format_real, parse_integer, parse_real, rounded
    from femtune.files.nastran.lists import IntegerList, Span, read_list
    from femtune.files.nastran.write import IncludeChange, WritePlan, WrittenDeck, plan_edits, write_deck
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "BuiltDeck",
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
    "WritePlan",
    "WrittenDeck",
    "build_structure",
    "edit_fields",
    "format_real",
    "parse_field_ref",
    "parse_integer",
    "parse_real",
    "plan_edits",
    "read_deck",
    "read_list",
    "resolve",
    "rounded",
    "write_deck",
]
