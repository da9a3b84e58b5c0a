"""Places of the sensors of a test on a model: by coordinates, after a motion of the test, or by number."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.correlation.registration import Motion, is_symmetry, register
from femtune.correlation.sensor_map import LENGTH_FACTORS, unit_ratio

if TYPE_CHECKING:
    from femtune.fem import Structure

_TIGHT = 1e-3
"""Distance over the diagonal of the model within which a sensor lies at a grid point."""
_LOOSE = 0.05
"""The largest tolerance over the diagonal that is proposed for coordinates as they are in the file."""
_LEAST_POINTS = 3
"""Points that fix a rigid motion."""
_AGREE = 0.9
"""Part of the test points with the number of their grid point from which numbers decide between motions that fit
equally well."""
_LISTED = 8
"""Test points that a sentence lists."""


@dataclass(frozen=True)
class AskedSensors:
    """What the user states of the sensors.

    Parameters
    ----------
    origin : of the test in the model; None to find it
    tolerance : largest distance of a test point from its grid point; None to find it
    by_id : test points have the numbers of their grid points
    """

    origin: tuple[float, float, float] | None = None
    tolerance: float | None = None
    by_id: bool = False


@dataclass(frozen=True)
class GuessedSensors:
    """How test points are assigned to grid points.

    Parameters
    ----------
    words : what was found
    sensors, test : keys of the tables [sensors] and [test]
    doubts : what should be checked
    factor : of the coordinates of the test, for a change of units
    others : other assignments that fit as well, among which mode shapes may decide
    several : what these others are; "" without any
    found : whether test points were assigned
    """

    words: str
    sensors: dict[str, Any] = field(default_factory=dict)
    test: dict[str, Any] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()
    factor: float = 1.0
    others: tuple[GuessedSensors, ...] = ()
    several: str = ""
    found: bool = True


def guess_sensors(
    structure: Structure, numbers: Integers, points: Reals, asked: AskedSensors | None = None
) -> GuessedSensors:
    """How the points of a test are assigned to the grid points of a model.

    Coordinates come first: as they are, then after a rigid motion, with a factor between units of length, that puts
    the points onto the mesh (`femtune.correlation.registration.register`). Numbers decide only between motions that fit
    equally well, and where the test has no coordinates.

    Parameters
    ----------
    structure : of the model
    numbers : (n,) of the test points
    points : (n, 3) their places in the unit of the model; NaN where they have none
    asked : what the user states
    """
    if not len(numbers):
        return GuessedSensors("the test has none, for it has frequencies without shapes", found=False)
    placed = _Placed(structure, numbers, points, asked or AskedSensors())
    if placed.asked.by_id:
        return placed.by_number_asked()
    ways = (placed.without_places, placed.as_they_are, placed.moved, placed.with_tolerance)
    return next((one for way in ways if (one := way()) is not None), placed.nowhere())


class _Placed:
    """Test points and grid points."""

    def __init__(self, structure: Structure, numbers: Integers, points: Reals, asked: AskedSensors) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415  slow to import

        nodes = structure.nodes
        self.nodes, self.numbers, self.asked = nodes, numbers, asked
        self.points = points if asked.origin is None else points + np.array(asked.origin)
        self.known = np.isfinite(points).all(axis=1)
        placed = points[self.known]
        self.placed = nodes.has_coordinates and bool(len(placed)) and len(nodes.xyz) > 0
        # export programs write 0, 0, 0 for points without a place
        self.placed &= len(placed) < _LEAST_POINTS or bool(np.ptp(placed, axis=0).any())
        self.diagonal = float(np.linalg.norm(np.ptp(nodes.xyz, axis=0))) if len(nodes.xyz) else 0.0
        self.tree = cKDTree(nodes.xyz) if len(nodes.xyz) else None
        self.rows = np.array([nodes.position(int(n)) if nodes.has_grid(int(n)) else -1 for n in numbers], np.int64)
        self.numbered = bool(len(numbers)) and bool((self.rows >= 0).all())
        self.default_tolerance = asked.tolerance or _TIGHT * self.diagonal
        self.keys = {} if asked.origin is None else {"origin": list(asked.origin)}

    def _own(self, part: float) -> float | None:
        """Largest distance, where all points lie near grid points of their own; None else."""
        if not self.placed or self.tree is None or not self.diagonal or not self.known.all():
            return None
        different = np.unique(self.points, axis=0)
        distance, at = self.tree.query(different)
        limit = max(part * self.diagonal, self.asked.tolerance or 0.0)
        near = distance.max() <= limit and len(set(at.tolist())) == len(different)
        return float(distance.max()) if near else None

    def without_places(self) -> GuessedSensors | None:
        """Test points without coordinates have the numbers of grid points."""
        if self.placed or not self.numbered:
            return None
        words = "each test point has the number of a grid point"
        if self.nodes.has_coordinates:
            words += ", and the test has no coordinates, or the same ones for all points"
        return GuessedSensors(words, {"by_id": True})

    def as_they_are(self) -> GuessedSensors | None:
        """Coordinates of the test are those of the model."""
        distance = self._own(_TIGHT)
        if distance is None:
            return None
        words = (
            f"each of the {len(self.numbers)} test points lies at a grid point of its own; the largest distance is "
            f"{distance:.2g}"
        )
        return GuessedSensors(words, self._tolerance(distance), dict(self.keys))

    def _tolerance(self, distance: float) -> dict[str, Any]:
        """The key, where the default does not cover the largest distance."""
        if self.asked.tolerance is not None:
            return {"tolerance": self.asked.tolerance}
        return {"tolerance": float(f"{1.05 * distance:.2g}")} if distance > _TIGHT * self.diagonal else {}

    def moved(self) -> GuessedSensors | None:
        """A rigid motion puts the test points onto the mesh."""
        if not self.placed or self.known.sum() < _LEAST_POINTS:
            return None
        factors = sorted(LENGTH_FACTORS, key=lambda one: abs(np.log(one)))
        if self.asked.origin is not None:
            factors = [1.0]
        points, rows = self.points[self.known], self.rows[self.known]
        registration = register(points, self.nodes.xyz, factors=factors, pairs=rows)
        if self.asked.origin is not None:
            registration = tuple(one for one in registration if one.is_unchanged)
        if not registration or (registration[0].is_unchanged and self._own(_LOOSE) is not None):
            return None
        agree = [np.mean((one.grids == rows)[one.grids >= 0]) for one in registration]
        by_number = max(agree) >= _AGREE and sum(a >= _AGREE for a in agree) == 1
        if by_number:
            registration = (registration[int(np.argmax(agree))],)
        first, *others = (self._with_motion(one, by_number) for one in registration)
        return replace(first, others=tuple(others), several=self._several(registration))

    def _several(self, motions: tuple[Motion, ...]) -> str:
        if len(motions) == 1:
            return ""
        others = motions[1:]
        symmetric = all(is_symmetry(motions[0], one, self.nodes.xyz) for one in others)
        mirrored = not motions[0].is_left_handed and any(one.is_left_handed for one in others)
        hands = " (some for left-handed axes of the test)" if mirrored else ""
        if symmetric:
            return (
                f"the mesh is symmetric: {_times(len(others), 'another motion', 'other motions')}{hands} would put the "
                "test points onto it as well; if this is the wrong one, state rotation and origin of [test]"
            )
        return (
            f"the motion is not unique: {_times(len(others), 'another one', 'others')}{hands} would put the test "
            "points onto the mesh nearly as well; state rotation and origin of [test] if you know them"
        )

    def _with_motion(self, one: Motion, by_number: bool) -> GuessedSensors:
        """The keys of a motion, with what it leaves out."""
        test = dict(self.keys) | _motion_keys(one, self.diagonal)
        differing = [
            word
            for word, key in (("the axes", "rotation"), ("the origin", "origin"), ("the unit", "coordinate_factor"))
            if key in test and key not in self.keys
        ]
        used = one.grids >= 0
        largest = float(one.distance[used].max())
        sensors = self._tolerance(largest)
        lost = self.numbers[self.known][~used]
        sensors |= self._unplaced(one, lost)
        doubts = tuple(self._motion_doubts(one, test, lost))
        words = (
            f"{used.sum()} of the {len(self.numbers)} test points have a grid point of their own; the largest distance "
            f"is {largest:.2g}"
        )
        if differing:
            one_only = len(differing) == 1 and differing[0] != "the axes"
            verb, those = ("differs", "that") if one_only else ("differ", "those")
            words = f"{_joined(differing)} of the test {verb} from {those} of the model: with the motion below {words}"
        if by_number:
            words += "; their numbers agree with this"
        return GuessedSensors(words, sensors, test, doubts, one.factor)

    def _unplaced(self, one: Motion, lost: Integers) -> dict[str, Any]:
        """Keys of test points without coordinates or without grid point."""
        keys: dict[str, Any] = {}
        without = self.numbers[~self.known]
        rows = self.rows[self.known]
        agree = np.mean((one.grids == rows)[one.grids >= 0]) >= _AGREE
        by_hand = {str(int(n)): int(n) for n, row in zip(without, self.rows[~self.known]) if row >= 0} if agree else {}
        if by_hand:
            keys["nodes"] = by_hand
        left = sorted({*map(int, lost), *(int(n) for n in without if str(int(n)) not in by_hand)})
        return keys | ({"leave_out": left} if left else {})

    def _motion_doubts(self, one: Motion, test: dict[str, Any], lost: Integers) -> Iterator[str]:
        if "coordinate_factor" in test:
            words = f"{LENGTH_FACTORS[one.factor]} (factor {one.factor:.6g})"
            yield f"the coordinates of the test look like {words}: check its unit"
        if test.get("left_handed"):
            yield "the axes of the test are left-handed: no right-handed axes put its points onto the mesh"
        keys = [key for key in ("rotation", "origin") if key in test and key not in self.keys]
        if keys:
            yield f"check {' and '.join(keys)} of [test] with the picture of the sensors"
        if len(lost):
            at = dict(zip(self.numbers[self.known].tolist(), one.distance.tolist()))
            names = ", ".join(f"{n} ({at[int(n)]:.3g})" for n in lost[:_LISTED])
            names += f" and {len(lost) - _LISTED} more" if len(lost) > _LISTED else ""
            yield (
                f"{_times(len(lost), 'test point has', 'test points have')} no grid point of their own within half an "
                f"element and are left out; number (distance): {names}"
            )

    def by_number_asked(self) -> GuessedSensors:
        """The user states that numbers are equal."""
        sensors: dict[str, Any] = {"by_id": True}
        words = "test points are assigned to the grid points with their numbers, as stated"
        used = self.known & (self.rows >= 0)
        if self.asked.tolerance is not None:
            sensors["tolerance"] = self.asked.tolerance
        if not self.placed or not used.any():
            return GuessedSensors(words, sensors, dict(self.keys))
        grids = self.nodes.xyz[self.rows[used]]
        distance = np.linalg.norm(self.points[used] - grids, axis=1)
        if distance.max() <= self.default_tolerance:
            return GuessedSensors(words, sensors, dict(self.keys))
        if self.asked.origin is None and used.sum() >= _LEAST_POINTS:
            for one in register(self.points[used], self.nodes.xyz, pairs=self.rows[used]):
                if (one.grids == self.rows[used]).all():
                    made = self._with_motion(one, by_number=True)
                    return replace(made, sensors=made.sensors | sensors)
        worst = np.argsort(-distance)[:_LISTED]
        names = ", ".join(f"{self.numbers[used][i]} ({distance[i]:.3g})" for i in worst)
        sensors.setdefault("tolerance", float(f"{1.05 * distance.max():.2g}"))
        doubt = (
            "the coordinates of the test points are not those of the grid points with their numbers; number "
            f"(distance): {names}"
        )
        ratio = unit_ratio(self.points[used], grids) if used.sum() >= _LEAST_POINTS else ""
        return GuessedSensors(words, sensors, dict(self.keys), (ratio or doubt,))

    def with_tolerance(self) -> GuessedSensors | None:
        """Each test point has a grid point of its own, which is not very near."""
        distance = self._own(_LOOSE)
        if distance is None:
            return None
        words = f"each test point has a nearest grid point of its own; the largest distance is {distance:.3g}"
        doubts = ("the mesh has no grid points at the sensors",)
        return GuessedSensors(words, self._tolerance(distance), dict(self.keys), doubts)

    def nowhere(self) -> GuessedSensors:
        """No way assigns all."""
        words = "the test points could not be assigned to grid points"
        if not self.placed:
            words += (
                ": the test has no coordinates for them, or the same ones for all, and their numbers are not those of "
                "grid points"
            )
        doubt = "list them in [sensors] nodes = { test point = grid point }, or correct coordinates, units and axes"
        doubts: tuple[str, ...] = (doubt,)
        if self.placed and self.numbered:
            doubts += (
                "the numbers of the test points are those of grid points, and their coordinates contradict these: use "
                "--by-id (in Python by_id=True) if the numbers are right",
            )
        return GuessedSensors(words, {}, dict(self.keys), doubts, found=False)


def _motion_keys(one: Motion, diagonal: float) -> dict[str, Any]:
    """The keys of [test] for a motion."""
    keys: dict[str, Any] = {}
    clean = np.where(np.abs(one.rotation - np.round(one.rotation)) < 1e-9, np.round(one.rotation), one.rotation)
    if not np.allclose(clean, np.eye(3), atol=1e-9):
        keys["rotation"] = [[round(float(x), 10) + 0.0 for x in row] for row in clean]
    if one.is_left_handed:
        keys["left_handed"] = True
    shift = np.where(np.abs(one.origin) <= 1e-9 * diagonal, 0.0, one.origin)
    if shift.any():
        keys["origin"] = [float(f"{x:.9g}") for x in shift]
    if one.factor != 1.0:
        keys["coordinate_factor"] = one.factor
    return keys


def _times(count: int, one: str, more: str) -> str:
    return one if count == 1 and not one.startswith("test") else f"{count} {one if count == 1 else more}"


def _joined(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
