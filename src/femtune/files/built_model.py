"""A model that was read and assembled, whatever it is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from femtune.errors import Notice, Where
from femtune.fem.fields import FieldRef
from femtune.fem.structure import Structure
from femtune.modal.beside import ModesBeside
from femtune.model.damping import ModalDamping

if TYPE_CHECKING:
    from femtune.files.nastran.building import FieldPlace
    from femtune.files.nastran.card import Card
    from femtune.files.nastran.deck import DeckParameter
    from femtune.files.nastran.inventory import CardUse
    from femtune.files.nastran.lists import IntegerList
    from femtune.files.nastran.source import SourceLine
    from femtune.model.imported.coverage import RunsCoverage


@dataclass(frozen=True)
class BuiltModel:
    """A structure and the files that it was read from.

    What only a deck can tell (cards, named sets, PARAMs) is empty for a model of matrices or runs; `BuiltDeck` has it.

    Parameters
    ----------
    files : all files, the main one first
    structure : the model
    notices : notices for the user, those of the reader first
    mode_count : number of modes that the runs of a model have, or None
    modal_damping : the table that SDAMPING selects, or None
    damping_tables : all tables of modal damping by number
    coverage : the runs of each configuration that a model of runs was fitted to
    beside : comparison of the modes of a study's external solver with those of its deck, by input
    cards : every card name with its count, the place of the first card, and its use
    fields : place in the deck of each value
    element_cards : index in `Deck.cards` of each element's card, by element number
    """

    files: tuple[str, ...]
    structure: Structure
    notices: tuple[Notice, ...]
    mode_count: int | None = None
    modal_damping: ModalDamping | None = None
    damping_tables: Mapping[int, ModalDamping] = field(default_factory=dict)
    coverage: tuple[RunsCoverage, ...] = ()
    beside: tuple[ModesBeside, ...] = ()
    cards: tuple[CardUse, ...] = ()
    fields: Mapping[FieldRef, FieldPlace] = field(default_factory=dict)
    element_cards: Mapping[int, int] = field(default_factory=dict)

    @property
    def params(self) -> Mapping[str, DeckParameter]:
        """Value of each PARAM."""
        return {}

    @property
    def sets(self) -> Mapping[int, IntegerList]:
        """SETs of the case control by number."""
        return {}

    @property
    def executive_lines(self) -> Sequence[SourceLine]:
        """Lines of the executive control."""
        return ()

    @property
    def damping_number(self) -> int | None:
        """Number of the table of modal damping."""
        return None

    @property
    def property_of_elements(self) -> Mapping[int, int]:
        """Number of the property card by element number; a blank one is the element's own number."""
        return {}

    def cards_named(self, name: str) -> Sequence[Card]:
        """All cards of one name."""
        return ()

    def place_of_grid(self, grid: int | None) -> Where:
        """The card of a grid point; the main file where there is none."""
        return Where(self.files[0])

    def place_of_element(self, element: int) -> Where | None:
        """The card of an element; None where there is none."""
        return None
