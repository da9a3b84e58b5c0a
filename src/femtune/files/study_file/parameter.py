"""[[parameter]]: what may change, how far, and which fields of the deck it moves."""

from __future__ import annotations

from femtune.fem.values import FieldRef
from femtune.files.nastran.lists import IntegerList
from femtune.files.study_file.kinds import (
    Elements,
    Expression,
    FieldText,
    Positive,
    Text,
    element_list,
    field_reference,
)
from femtune.files.study_file.table import Table


class ParameterEntry(Table):
    """A free parameter (bounds) or a tied one (an expression of others)."""

    name: Text
    fields: tuple[FieldText, ...] = ()
    elements: Elements | None = None
    lower: float | None = None
    upper: float | None = None
    nominal: float | None = None
    absolute: bool = False
    sd: Positive | None = None
    mean: float | None = None
    tie: Expression | None = None
    unit: str = ""

    @property
    def free(self) -> bool:
        """True where no tie binds it."""
        return self.tie is None

    @property
    def targets(self) -> tuple[FieldRef, ...]:
        """The fields that it moves."""
        return tuple(field_reference(text) for text in self.fields)

    @property
    def region(self) -> IntegerList | None:
        """The elements whose fields it moves, None for all that use them."""
        return None if self.elements is None else element_list(self.elements)
