"""[study]: what a study is about, and the deck of its structure."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from femtune.files.study_file.kinds import DeckName, NamesFile, Text, TomlTable, Units
from femtune.units import UnitSystem, unit_system


class StudyTable(TomlTable):
    """[study]: title, deck and units."""

    title: Text
    """Title of the report. Example: `"Two-storey steel building"`"""
    deck: DeckName | None = None
    """The Nastran bulk data file. Required, unless the model is made of [matrices](#matrix) or [runs](#runs), or is an
    external [solver](#solver). Example: `"building.bdf"`"""
    units: Units
    """Units of length, mass and time of the deck; lengths m, cm, mm, in, ft; masses kg, g, t, lbm, slug, slinch; or a
    force N, kN, MN, lbf, kip instead of the mass: `"in-lbf-s"`, `"kip-ft-s"`, whose unit of mass is lbf·s²/in (slinch)
    and kip·s²/ft. A deck does not state its units. Example: `"mm-t-s"`"""
    allow_ignored: tuple[Text, ...] = ()
    """Cards that may be ignored although the modes depend on them. Example: `["CTRIAX6"]`"""
    choices: Annotated[Text, NamesFile("file of choices")] | None = None
    """Choices that were made on the page of a [report](guide/report.md#choices) and saved as `choices.toml`; they are
    refused if the deck or a test has changed since. Example: `"choices.toml"`"""
    journal: bool = True
    """Store all solutions of the full model in the run folder, so that [an interrupted run
    continues](guide/interrupted-runs.md). Example: `false`"""
    journal_gib: Annotated[float, Field(gt=0, le=1e6)] = 10.0
    """Size at which the journal stops growing, GiB. Example: `50.0`"""

    @property
    def unit_system(self) -> UnitSystem:
        """The units of the deck and of all values in the study."""
        return unit_system(self.units)
