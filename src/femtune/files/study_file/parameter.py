"""[[parameter]]: what may change, how far, and which fields of the deck it moves."""

from __future__ import annotations

from femtune.fem.values import FieldRef
from femtune.files.study_file.kinds import (
    Elements,
    Expression,
    FieldText,
    Positive,
    Text,
    field_reference,
)
from femtune.files.study_file.region import RegionTable
from femtune.files.study_file.table import Table


class ParameterEntry(Table):
    """A free parameter (bounds) or a tied one (an expression of others)."""

    name: Text
    fields: tuple[FieldText, ...] = ()
    elements: Elements | None = None
    region: RegionTable | None = None
    lower: float | None = None
    upper: float | None = None
    nominal: float | None = None
    absolute: bool = False
    sd: Positive | None = None
    mean: float | None = None
    prior: Text | None = None
    prior_name: Text | None = None
    tie: Expression | None = None
    unit: str = ""

    @property
    def free(self) -> bool:
        """True where no tie binds it."""
        return self.tie is None

    @property
    def targets(self) -> tuple[FieldRef, ...]:
        """The fields that it moves; number 0 stands for all cards of the name."""
        return tuple(field_reference(text) for text in self.fields)
