"""[[frequency_table]]: fields of the model that are functions of frequency."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.study_file.kinds import FieldText, NotNegative, Positive, TomlTable, field_reference
from femtune.files.study_file.source import StudyLines, tables


class FrequencyTableEntry(TomlTable):
    """A factor over frequency, and the fields that it multiplies."""

    fields: Annotated[tuple[FieldText, ...], Field(min_length=1)]
    """Fields of stiffness, dashpots or loss factors, as in `[[parameter]]`; without a number: the field of all cards of
    this name. Example: `["MAT1 2 E"]`"""
    freq_hz: Annotated[tuple[NotNegative, ...], Field(min_length=1)]
    """Ascending frequencies. Example: `[0.0, 50.0, 200.0]`"""
    factor: Annotated[tuple[Positive, ...], Field(min_length=1)]
    """Factor on the value of the deck, or of the parameter, at each frequency; linear between the frequencies, constant
    outside. Example: `[0.8, 1.0, 1.6]`"""

    @property
    def targets(self) -> tuple[FieldRef, ...]:
        """The fields; number 0 stands for all cards of the name."""
        return tuple(field_reference(text) for text in self.fields)


def frequency_table_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Refuse tables over frequency in studies with reduced models."""
    for place, _ in tables(data, "frequency_table"):
        for key, word in (("reduction", "[reduction]"), ("matrix", "[[matrix]]")):
            if key in data:
                yield source.error(place, "study.frequency-table", {}, other=word)
