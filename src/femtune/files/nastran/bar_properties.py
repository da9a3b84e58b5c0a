"""Sections of bars and beams by property number: PBAR, PBARL, PBEAM, PBEAML, PBCOMP, with their material."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from femtune.fem.values import FieldRef
from femtune.files.nastran.beam_stations import BeamSection
from femtune.files.nastran.building import Building, Library
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.composite_beams import read_pbcomp
from femtune.files.nastran.materials import Materials
from femtune.files.nastran.pbeam import read_pbeam
from femtune.files.nastran.properties import Properties
from femtune.files.nastran.record import Record
from femtune.files.nastran.shaped_beams import read_pbarl, read_pbeaml


@dataclass
class BarProperties:
    """Sections with the material's E G rho GE, by property number."""

    building: Building
    properties: Properties
    materials: Materials
    _library: Library[BeamSection] = field(init=False)

    def __post_init__(self) -> None:
        self._library = Library(self._make)

    def get(self, pid: int, user: Record) -> BeamSection:
        """The section of a property, asked for by an element."""
        self.properties.find(pid, user)
        return self._library.get(pid, user)

    def _make(self, pid: int, user: Record) -> BeamSection:
        record = self.properties.find(pid, user)
        material = self.materials.get(record.integer("MID"), record)
        section = self._section(record, pid, material)
        if self.building.values.values[material["G"]] == 0.0:
            _check_constant(record, section)
            # without a shear modulus there is no shear flexibility either
            none = self.building.values.add(FieldRef(record.name, pid, "no shear flexibility"), 0.0)
            stiff = {name: none for name in section.roles if name[:2] in ("K1", "K2")}
            section = replace(section, roles={**section.roles, **stiff})
        return replace(section, roles={**material, **section.roles})

    def _section(self, record: Record, pid: int, material: Mapping[str, int]) -> BeamSection:
        if record.name == "PBCOMP":
            return read_pbcomp(self.building, record, pid, material, self.materials)
        return _READERS[record.name](self.building, record, pid)


def _check_constant(record: Record, section: BeamSection) -> None:
    """Beams that change along their length, or whose axes lie beside each other, are made by their flexibility."""
    if section.stations:
        what = f"the section of {record.name} needs a material with a shear modulus: it changes along the beam, or its "
        raise record.error("deck.section", what + "neutral axis or mass lies beside the element's axis", at="MID",
                           hint="give the material G or NU")  # fmt: skip


def read_pbar(b: Building, record: Record, pid: int) -> BeamSection:
    """A constant section of a bar."""
    return BeamSection({n: b.value(record, pid, n) for n in ("A", "I1", "I2", "I12", "J", "K1", "K2", "NSM")})


_READERS = {"PBAR": read_pbar, "PBARL": read_pbarl, "PBEAM": read_pbeam, "PBEAML": read_pbeaml}
assert set(_READERS) <= set(CATALOGUE)
