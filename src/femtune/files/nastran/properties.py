"""Property cards by number, and which of them an element may use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from femtune.errors import did_you_mean
from femtune.files.nastran.building import Building
from femtune.files.nastran.record import Record

FAMILIES: Mapping[str, tuple[str, ...]] = {
    "CBAR": ("PBAR", "PBARL"),
    "CBEAM": ("PBEAM", "PBEAML", "PBCOMP"),
    "CROD": ("PROD",),
    "CELAS1": ("PELAS",),
    "CELAS3": ("PELAS",),
    "CDAMP1": ("PDAMP",),
    "CDAMP3": ("PDAMP",),
    "CVISC": ("PVISC",),
    "CBUSH1D": ("PBUSH1D",),
    "CBUSH": ("PBUSH",),
    "CMASS1": ("PMASS",),
    "CMASS3": ("PMASS",),
    **dict.fromkeys(("CHEXA", "CPENTA", "CTETRA", "CPYRAM"), ("PSOLID",)),
    "CSHEAR": ("PSHEAR",),
    **dict.fromkeys(("CQUAD4", "CTRIA3", "CQUAD8", "CTRIA6"), ("PSHELL", "PCOMP", "PCOMPG")),
}
"""Property cards that an element may refer to."""

_NO_PROPERTIES = ("PARAM", "PAERO", "PLOAD", "PLOT", "POINT", "PRES", "PSET", "PVAL", "PANEL")


@dataclass(frozen=True)
class Properties:
    """Property cards of one element's family, and the names of all other property cards by number."""

    own: Mapping[int, Record]
    others: Mapping[int, str]

    def find(self, pid: int, user: Record) -> Record:
        """The property card of a number, asked for by an element.

        Raises
        ------
        FemtuneError : ``deck.unknown-property``, ``deck.property-type``
        """
        if pid in self.own:
            return self.own[pid]
        *others, last = FAMILIES[user.name]
        expected = f"{', '.join(others)} or {last}" if others else last
        if pid in self.others:
            raise user.error(
                "deck.property-type",
                f"property {pid} is a {self.others[pid]}; {user.name} needs a {expected}",
                hint=f"refer to a {expected} card",
            )
        known = did_you_mean(str(pid), [str(k) for k in list(self.own)[:20]])
        raise user.error("deck.unknown-property", f"property {pid} does not exist",
                         hint=known or f"add a {expected} card of that number")  # fmt: skip


def read_properties(building: Building, element: str) -> Properties:
    """Property cards for one element card; a number given twice in the family is an error."""
    own = building.by_number(building.records(*FAMILIES[element]), "property")
    return Properties(own, _names(building, FAMILIES[element]))


def _names(building: Building, family: tuple[str, ...]) -> dict[int, str]:
    """Names of the property cards of other families, read or not, by number."""
    found = {}
    for name, cards in building.deck.names.items():
        if name.startswith("P") and name not in family and not name.startswith(_NO_PROPERTIES):
            found.update({card.integer(0, 0): name for card in cards if card.is_integer(0)})
    return found
