"""Thickness of a shell element: its property's, or what stands at its corners, and the mean of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from operator import mul
from typing import Any

from femtune.errors import Notice, Where
from femtune.fem.values import FieldRef
from femtune.files.nastran.building import Building
from femtune.files.nastran.record import Record
from femtune.files.nastran.shell_properties import ShellSection

_MOST_DIFFERENCE = 0.2


@dataclass
class Thicknesses:
    """Positions of the thicknesses of one card's elements, and those whose corners differ much.

    `made_even` is False where the elements have the thickness that varies, and not its mean.
    """

    building: Building
    corners: tuple[str, ...]
    made_even: bool = True
    uneven: list[Where] = field(default_factory=list)

    def get(self, record: Record, eid: int, section: ShellSection) -> int:
        """Position of an element's thickness.

        Raises
        ------
        FemtuneError : ``deck.shell-section`` where there is none, ``deck.field-value`` for TFLAG
        """
        given, relative = self._given(record, section)
        if not given:
            return self._of_property(record, section)
        # factors are of the property's thickness, and blank corners have it
        own = [self._of_property(record, section)] if relative or len(given) < len(self.corners) else []
        corners = {name: self.building.value(record, eid, name) for name in given}
        rule = scaled_mean(len(self.corners)) if relative else corner_mean(len(self.corners))
        values = self.building.values.values
        self._check(record, {name: values[i] for name, i in corners.items()}, own, relative)
        at = [*own, *corners.values()]
        nominal = rule(*(values[i] for i in at))
        return self.building.values.derive(FieldRef(record.name, eid, "T"), rule, *at, nominal=nominal)

    def at_corners(self, record: Record, eid: int, section: ShellSection) -> list[int] | None:
        """Positions of the thickness at each corner, None where all of it is the property's; errors as of ``get``."""
        given, relative = self._given(record, section)
        if not given:
            return None
        return [self._corner(record, eid, section, name, name in given, relative) for name in self.corners]

    def _corner(
        self, record: Record, eid: int, section: ShellSection, name: str, given: bool, relative: bool
    ) -> int:  # fmt: skip
        if not given:
            return self._of_property(record, section)
        value = self.building.value(record, eid, name)
        if not relative:
            return value
        ref = FieldRef(record.name, eid, f"{name} thickness")
        return self.building.values.derive(ref, mul, value, self._of_property(record, section))

    def _given(self, record: Record, section: ShellSection) -> tuple[list[str], bool]:
        """Names of the fields that are filled, and whether they are factors."""
        if len(record.card.fields) <= min(record.at("TFLAG"), record.at(self.corners[0])):
            return [], False
        given = [name for name in self.corners if not record.blank(name)]
        if given and section.layered:
            raise record.error("deck.shell-section", f"{self._names} stand on an element whose property is a laminate",
                               at=given[0], hint="leave them blank: the plies have the thickness")  # fmt: skip
        return given, self._relative(record)

    def _of_property(self, record: Record, section: ShellSection) -> int:
        if section.thickness is None:
            what = f"the element has no thickness: T of PSHELL {section.number} is blank, and so are {self._names}"
            raise record.error("deck.shell-section", what, hint="fill T of the PSHELL")
        return section.thickness

    @property
    def _names(self) -> str:
        return f"{self.corners[0]} to {self.corners[-1]}"

    def _relative(self, record: Record) -> bool:
        """TFLAG: 0 or blank for thicknesses, 1 for factors of the property's."""
        flag: int = record.integer("TFLAG", 0)
        if flag not in (0, 1):
            raise record.error("deck.field-value", f"TFLAG of {record.name} should be 0, 1 or blank", at="TFLAG",
                               hint="1 makes T1 and the others factors of the property's thickness")  # fmt: skip
        return flag == 1

    def _check(self, record: Record, corners: dict[str, float], own: list[int], relative: bool) -> None:
        worst = min(corners, key=corners.__getitem__)
        if corners[worst] < 0.0 or max(corners.values()) == 0.0:
            raise record.error("deck.shell-section", f"{self._names} of a shell should be positive", at=worst,
                               hint="correct the thickness")  # fmt: skip
        blank = 1.0 if relative else self.building.values.values[own[0]] if own else 0.0
        every = [*corners.values(), *[blank] * (len(self.corners) - len(corners))]
        if self.made_even and max(every) - min(every) > _MOST_DIFFERENCE * sum(every) / len(every):
            self.uneven.append(record.where)

    def notices(self, card: str) -> list[Notice]:
        """What the user should know of elements that are not of one thickness."""
        if not self.uneven:
            return []
        n = len(self.uneven)
        what = (
            f"{n} {card} element{'s have' if n > 1 else ' has'} thicknesses {self._names} that differ by more than "
            "20 %; the element is made with their mean"
        )
        return [Notice("deck.uneven-thickness", what, self.uneven[0])]


@cache
def corner_mean(n: int) -> Callable[..., Any]:
    """Mean over n corners of thicknesses; the first one given stands for those that are blank too."""

    def mean(first: Any, *others: Any) -> Any:
        total = first * float(n - len(others))
        for one in others:
            total = total + one
        return total / float(n)

    return mean


@cache
def scaled_mean(n: int) -> Callable[..., Any]:
    """A thickness times the mean over n corners of factors, 1 where blank."""

    def mean(thickness: Any, *factors: Any) -> Any:
        total = factors[0] + float(n - len(factors))
        for one in factors[1:]:
            total = total + one
        return thickness * total / float(n)

    return mean
