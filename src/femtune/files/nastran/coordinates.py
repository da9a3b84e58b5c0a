"""Coordinate systems CORD1R/C/S and CORD2R/C/S: rectangular, cylindrical, spherical, chained."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError, did_you_mean
from femtune.files.nastran.card import CardEntry

_LONGEST_CHAIN = 200
"""Longest chain of systems defined in terms of each other; real decks have a few, and recursion is limited."""
_ON_AXIS = 1e-10
"""Distance from the axis, relative to the coordinates (at least 1), up to which the radial direction is undefined.

Above the rounding of coordinates, so that the direction is never one of rounding errors.
"""


@dataclass(frozen=True)
class CoordinateSystem:
    """A coordinate system: `shape` "R", "C" or "S"; `origin` (3,) and `axes` (3, 3), columns, in the basic frame."""

    id: int
    shape: str
    origin: Reals
    axes: Reals

    def point(self, x: Reals) -> Reals:
        """Basic coordinates of a point given in this system (r, θ°, z or r, θ°, φ° if it is not rectangular)."""
        return self.origin + self.axes @ _rectangular(self.shape, np.asarray(x, dtype=float))

    def frame(self, at: Reals) -> Reals:
        """(3, 3) unit axes, as columns in the basic frame, of components at a point in basic coordinates.

        On the axis of a cylindrical or spherical system, where the radial direction is undefined, θ = 0 is used.
        """
        if self.shape == "R":
            return self.axes
        local = self.axes.T @ (np.asarray(at, dtype=float) - self.origin)
        return self.axes @ _local_frame(self.shape, local)


BASIC = CoordinateSystem(0, "R", np.zeros(3), np.eye(3))


def _rectangular(shape: str, x: Reals) -> Reals:
    if shape == "R":
        return x
    a, b = np.radians(x[1]), np.radians(x[2])
    if shape == "C":
        return np.array([x[0] * np.cos(a), x[0] * np.sin(a), x[2]])
    return x[0] * np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])


def _local_frame(shape: str, x: Reals) -> Reals:
    r = np.hypot(x[0], x[1])
    off_axis = r > _ON_AXIS * max(1.0, length(x))
    c, s = (x[0] / r, x[1] / r) if off_axis else (1.0, 0.0)
    if shape == "C":
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    theta = np.arctan2(r, x[2]) if np.any(x) else 0.0
    ct, st = np.cos(theta), np.sin(theta)
    return np.array([[st * c, ct * c, -s], [st * s, ct * s, c], [ct, -st, 0.0]])


def cross(a: Reals, b: Reals) -> Reals:
    """Vector product of two vectors; much faster for single vectors than NumPy's."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def length(a: Reals) -> float:
    """Euclidean length of a vector."""
    return math.sqrt(float(a @ a))


def system_through(id: int, shape: str, a: Reals, b: Reals, c: Reals) -> CoordinateSystem | None:
    """System with origin A, z-axis through B and C in the x-z plane; None if the points are collinear."""
    z, out = b - a, c - a
    y = cross(z, out)
    if length(y) <= 1e-10 * length(z) * length(out):
        return None
    z, y = z / length(z), y / length(y)
    return CoordinateSystem(id, shape, a, np.column_stack([cross(y, z), y, z]))


@dataclass
class CoordinateSystems:
    """Systems by number, resolved on first use.

    Parameters
    ----------
    records : the cards by number
    grid_location : basic coordinates of a grid point, for CORD1 cards
    basic : system 0
    """

    records: Mapping[int, CardEntry]
    grid_location: Callable[[int, CardEntry], Reals]
    basic: CoordinateSystem = BASIC
    _known: dict[int, CoordinateSystem | FemtuneError] = field(default_factory=dict)
    _pending: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._known[0] = self.basic

    def get(self, cid: int, user: CardEntry) -> CoordinateSystem:
        """The system of a number that a card refers to.

        Raises
        ------
        FemtuneError : ``deck.unknown-coordinate-system``, ``deck.circular-coordinates``,
            ``deck.degenerate-coordinates``
        """
        if cid not in self._known:
            self._known[cid] = self._resolved(cid, user)
        system = self._known[cid]
        if isinstance(system, FemtuneError):
            raise system
        return system

    def _resolved(self, cid: int, user: CardEntry) -> CoordinateSystem | FemtuneError:
        if cid not in self.records:
            return _unknown(cid, user, self.records)
        if cid in self._pending or len(self._pending) > _LONGEST_CHAIN:
            raise _circular([*self._pending, cid], self.records[cid])
        self._pending.append(cid)
        try:
            return self._build(cid, self.records[cid])
        except FemtuneError as error:
            return error
        finally:
            self._pending.pop()

    def _build(self, cid: int, record: CardEntry) -> CoordinateSystem:
        points = self._from_grids(record) if record.name.startswith("CORD1") else self._from_points(record)
        system = system_through(cid, record.name[-1], *points)
        if system is None:
            raise record.error("deck.degenerate-coordinates", cid=cid)
        return system

    def _from_grids(self, record: CardEntry) -> tuple[Reals, Reals, Reals]:
        a, b, c = (self.grid_location(record.integer(name), record) for name in ("G1", "G2", "G3"))
        return a, b, c

    def _from_points(self, record: CardEntry) -> tuple[Reals, Reals, Reals]:
        base = self.get(record.integer("RID", 0), record)
        a, b, c = (base.point(np.array(record.reals(p + "1", p + "2", p + "3"))) for p in "ABC")
        return a, b, c


def _unknown(cid: int, user: CardEntry, known: Mapping[int, CardEntry]) -> FemtuneError:
    return user.error(
        "deck.unknown-coordinate-system",
        hint=did_you_mean(str(cid), [str(k) for k in list(known)[:20]]) or "the deck defines none; use 0",
        cid=cid,
    )


def _circular(chain: list[int], record: CardEntry) -> FemtuneError:
    shown = chain[chain.index(chain[-1]) :] if chain[-1] in chain[:-1] else chain[-10:]
    long = "" if chain[-1] in chain[:-1] else f" (more than {_LONGEST_CHAIN} systems long)"
    return record.error("deck.circular-coordinates", length_of_chain=long, chain=" -> ".join(map(str, shown)))
