"""Records of the updated deck: edited fields and new cards."""

from __future__ import annotations

from femtune.study.record import Record


class EditedField(Record):
    """A field of the deck that was changed; references to new cards are in RepointedElements."""

    card: str
    """Card and identification: "PBAR 1"."""
    field: str
    """Name of the field: "I1"."""
    file: str
    """File of the deck that was read, relative to the study file."""
    line: int
    """Line in that file, from 1."""
    old_text: str
    """Text before."""
    new_text: str
    """Text after."""
    value: float | None
    """Value of the update, before rounding, in units of the deck; None for a text."""
    rounded_value: float | None
    """Value of the new text, in units of the deck; None for a text."""
    parameter: str = ""
    """Parameter that sets it."""


class NewCardValue(Record):
    """A field in which a new card differs from the one that it was copied from."""

    field: str
    """Name of the field: "T"."""
    old_text: str
    """Text in the card that was copied, before the update."""
    value: float
    """Value of the update, before rounding, in units of the deck; for a reference the number of the card."""
    rounded_value: float
    """Value that the new card holds, in units of the deck."""
    parameter: str = ""
    """Parameter that sets it; "" for a reference to another new card."""


class NewCardFacts(Record):
    """A card that was added to the deck: a copy with other values, for the elements of a region."""

    card: str
    """Card and identification: "PSHELL 21"."""
    copied_from: str
    """Card that it is a copy of: "PSHELL 1"."""
    region: str
    """Parameters whose regions it is for."""
    elements: int
    """Number of elements that refer to it."""
    values: tuple[NewCardValue, ...]
    """Fields in which it differs, apart from its number."""


class RepointedElements(Record):
    """Elements of one kind that refer to a new card."""

    card: str
    """Kind of element: "CQUAD4"."""
    field: str
    """Field that holds the reference: "PID"."""
    before: str
    """Text of the field before: "1"; "" if it was blank."""
    after: str
    """Card that it refers to now: "PSHELL 21"."""
    elements: tuple[int, ...]
    """Numbers of the elements."""


class WriteBackResults(Record):
    """Changes in the updated deck."""

    files: tuple[str, ...]
    """Files written, relative to the run folder."""
    edits: tuple[EditedField, ...]
    """Changed fields."""
    new_cards: tuple[NewCardFacts, ...] = ()
    """Cards that were added for the elements of regions."""
    repointed: tuple[RepointedElements, ...] = ()
    """Elements that refer to them."""
    splits: tuple[str, ...]
    """Cards split because elements that are not updated share them, a sentence each."""
    without_field: tuple[str, ...]
    """Parameters that have no field, a sentence each."""
    lost: tuple[str, ...] = ()
    """Those of these sentences whose updated values the written deck does not contain; only in results of versions that
    wrote such a deck."""
    differences: tuple[str, ...] = ()
    """Differences of the written deck from the update, a sentence each; the deck is not called updated.bdf then."""
    includes_changed: tuple[str, ...]
    """INCLUDE lines whose path was changed, a sentence each."""
