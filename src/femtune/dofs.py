"""Degrees of freedom: a node and a signed direction, written ``101Z+``; all three parts are required."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import total_ordering
from typing import TYPE_CHECKING, Any

from femtune.errors import FemtuneError

if TYPE_CHECKING:
    from femtune.arrays import Integers, Reals

DIRECTIONS = ("S", "X", "Y", "Z", "RX", "RY", "RZ")
"""Code 0 is a scalar point; 1 to 6 are the components of Nastran."""

# 18 digits fit in a 64-bit integer
_PATTERN = re.compile(r"([0-9]{1,18})(S|R?[XYZ])([+-])")


@total_ordering
@dataclass(frozen=True)
class Dof:
    """One degree of freedom: `node` > 0, `direction` one of DIRECTIONS, `sign` +1 or −1.

    DOFs sort by node, then by component (X Y Z RX RY RZ), then by sign.

    Raises
    ------
    FemtuneError : ``dof.syntax``

    Examples
    --------
    >>> import femtune as ft
    >>> str(ft.Dof(101, "Z"))
    '101Z+'
    """

    node: int
    direction: str
    sign: int = 1

    def __post_init__(self) -> None:
        if self.node <= 0 or self.direction not in DIRECTIONS or self.sign not in (1, -1):
            raise _bad_dof(f"{self.node}{self.direction}", self.sign)

    def __str__(self) -> str:
        return f"{self.node}{self.direction}{'+' if self.sign > 0 else '-'}"

    def __lt__(self, other: Dof) -> bool:
        return (self.node, self.component, self.sign) < (other.node, other.component, other.sign)

    @property
    def component(self) -> int:
        """Nastran's component: 0 for a scalar point, 1 to 3 translations, 4 to 6 rotations."""
        return DIRECTIONS.index(self.direction)


def _bad_dof(text: object, sign: object = "") -> FemtuneError:
    return FemtuneError("dof.syntax", values={} if sign == "" else {"sign": sign}, text=text)


def parse_dof(text: str) -> Dof:
    """Read ``101Z+``; node, direction and sign are required.

    Raises
    ------
    FemtuneError : ``dof.syntax``
    """
    match = _PATTERN.fullmatch(text.strip())
    if not match or int(match[1]) == 0:
        raise _bad_dof(text)
    return Dof(int(match[1]), match[2], 1 if match[3] == "+" else -1)


class DofSet:
    """An ordered set of degrees of freedom without repetition (each direction of a node occurs once).

    Parameters
    ----------
    dofs : the DOFs in their order

    Raises
    ------
    FemtuneError : ``dof.duplicate`` if a node and direction occur twice, with any sign

    Examples
    --------
    >>> import femtune as ft
    >>> ft.DofSet.parse(["101Z+", "102Z-"]).nodes
    array([101, 102])
    """

    def __init__(self, dofs: Iterable[Dof]) -> None:
        self._dofs = tuple(dofs)
        wrong = next((dof for dof in self._dofs if not isinstance(dof, Dof)), None)
        if wrong is not None:
            facts: dict[str, Any] = {
                "name": "dofs",
                "function": "DofSet",
                "allowed": "a sequence of Dof",
                "given": type(wrong).__name__,
            }
            hint = 'from texts: DofSet.parse(["12Z+", "13Z+"])'
            raise FemtuneError("call.argument", values={"entry": repr(wrong)}, hint=hint, **facts)
        self._index = {(d.node, d.direction): i for i, d in enumerate(self._dofs)}
        if len(self._index) != len(self._dofs):
            raise FemtuneError("dof.duplicate", dof=self._first_repeated())

    def _first_repeated(self) -> Dof:
        return next(d for i, d in enumerate(self._dofs) if self._index[(d.node, d.direction)] != i)

    @classmethod
    def parse(cls, texts: Iterable[str]) -> DofSet:
        """From texts such as ``101Z+``."""
        return cls(parse_dof(text) for text in texts)

    def __len__(self) -> int:
        return len(self._dofs)

    def __iter__(self) -> Iterator[Dof]:
        return iter(self._dofs)

    def __repr__(self) -> str:
        return f"DofSet({' '.join(self.labels())})"

    def __getitem__(self, i: int) -> Dof:
        return self._dofs[i]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, DofSet) and self._dofs == other._dofs

    def __hash__(self) -> int:
        return hash(self._dofs)

    def __contains__(self, dof: Dof) -> bool:
        return (dof.node, dof.direction) in self._index

    @property
    def nodes(self) -> Integers:
        """Node numbers, one per DOF."""
        import numpy as np  # noqa: PLC0415  a study file is checked before numpy is imported

        return np.array([d.node for d in self._dofs], dtype=np.int64)

    @property
    def components(self) -> Integers:
        """Components 0 to 6, one per DOF."""
        import numpy as np  # noqa: PLC0415

        return np.array([d.component for d in self._dofs], dtype=np.int64)

    @property
    def signs(self) -> Reals:
        """+1 or −1, one per DOF."""
        import numpy as np  # noqa: PLC0415

        return np.array([d.sign for d in self._dofs], dtype=float)

    def labels(self) -> list[str]:
        """Texts such as ``101Z+``."""
        return [str(d) for d in self._dofs]

    def select(self, keep: Iterable[int]) -> DofSet:
        """The DOFs at the given positions, in that order."""
        return DofSet(self._dofs[i] for i in keep)

    def align(self, other: DofSet) -> tuple[Integers, Reals]:
        """Positions in `other` of each DOF of this set, and the relative signs (+1 or −1).

        Raises
        ------
        FemtuneError : ``dof.missing`` if `other` lacks one
        """
        import numpy as np  # noqa: PLC0415

        missing = [str(d) for d in self._dofs if d not in other]
        if missing:
            raise FemtuneError(
                "dof.missing",
                values={"missing": " ".join(missing[:5]) + (" …" if len(missing) > 5 else "")},
                n_missing=len(missing),
                n_dofs=len(self),
            )
        at = np.array([other._index[(d.node, d.direction)] for d in self._dofs], dtype=np.int64)
        return at, self.signs * other.signs[at]

    def common(self, other: DofSet) -> DofSet:
        """The DOFs in both sets, in the order and with the signs of this one."""
        return DofSet(d for d in self._dofs if d in other)
