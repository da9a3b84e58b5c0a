"""Record: a card read by the names of its fields, with the defaults that another card gives."""

from __future__ import annotations

from dataclasses import dataclass
from types import EllipsisType
from typing import Any

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.card import Card
from femtune.files.nastran.catalogue import CATALOGUE

# squares and products of coordinates stay numbers
_LARGEST = 1e30


@dataclass(frozen=True)
class Record:
    """A card, or one of the entries of a card that holds several.

    Parameters
    ----------
    card : the card
    names : names of the fields, from position `start` of the card
    start : position of the first name
    defaults : record whose fields stand in for blank ones (GRDSET, BAROR, BEAMOR)
    """

    card: Card
    names: tuple[str, ...]
    start: int = 0
    defaults: Record | None = None

    @property
    def name(self) -> str:
        """Name of the card."""
        return self.card.name

    @property
    def where(self) -> Where:
        """Place of the card."""
        return self.card.where()

    def at(self, name: str) -> int:
        """Index of a field in the card."""
        return self.start + self.names.index(name)

    def blank(self, name: str) -> bool:
        """Whether a field is blank, here and in the defaults."""
        return self._source(name).card.blank(self.at(name))

    def has_integer(self, name: str) -> bool:
        """Whether a field holds an integer."""
        return self._source(name).card.is_integer(self.at(name))

    def integer(self, name: str, default: int | EllipsisType | None = ...) -> Any:
        """Integer in a field; without default a blank field is an error."""
        return self._source(name).card.integer(self.at(name), default)  # type: ignore[arg-type]

    def real(self, name: str, default: float | EllipsisType | None = ...) -> Any:
        """Real number in a field; without default a blank field is an error."""
        return self._source(name).card.real(self.at(name), default)  # type: ignore[arg-type]

    def reals(self, *names: str) -> list[float]:
        """Components of a point or vector, 0 where blank (error ``deck.field-value`` beyond all sizes)."""
        found = [self.real(name, 0.0) for name in names]
        for name, x in zip(names, found):
            if abs(x) > _LARGEST:
                raise self.error("deck.field-value", "a coordinate is beyond all sizes", at=name,
                                 hint="correct its exponent")  # fmt: skip
        return found

    def text(self, name: str, default: str = "") -> str:
        """Text in a field, upper case."""
        return self._source(name).card.text(self.at(name), default)

    def component(self, name: str, default: str = "") -> str:
        """Components in a field."""
        return self._source(name).card.component(self.at(name), default)

    def error(self, code: str, what: str, *, at: str | None = None, hint: str = "") -> FemtuneError:
        """An error at this card, or at one of its fields."""
        return self.card.error(code, what, index=None if at is None else self.at(at), hint=hint)

    def _source(self, name: str) -> Record:
        if self.defaults is None or name not in self.defaults.names or not self.card.blank(self.at(name)):
            return self
        return self.defaults


def records_of(card: Card, defaults: Record | None = None) -> list[Record]:
    """The entries of a card; later entries of a card of several that are blank are left out."""
    kind = CATALOGUE[card.name]
    return [
        Record(card, kind.fields, start, defaults)
        for start in kind.starts
        if start == 0 or not card.blank(start)
    ]  # fmt: skip
