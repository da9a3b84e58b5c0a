"""Places of the sensors of a test on a model: by coordinates, after a change of axes, or by number."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.correlation.sensor_map import axis_changes, unit_ratio

if TYPE_CHECKING:
    from femtune.fem import Structure

_TIGHT = 1e-3
"""Distance over the diagonal of the model within which a sensor lies at a grid point."""
_LOOSE = 0.05
"""The largest tolerance over the diagonal that is proposed."""
_LEAST_POINTS = 3
"""Points that fix a rigid motion."""


@dataclass(frozen=True)
class GuessedSensors:
    """How test points are assigned to grid points.

    Parameters
    ----------
    words : what was found
    sensors, test : keys of the tables [sensors] and [test]
    doubts : what should be checked
    """

    words: str
    sensors: dict[str, Any] = field(default_factory=dict)
    test: dict[str, Any] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()


def guess_sensors(structure: Structure, numbers: Integers, points: Reals) -> GuessedSensors:
    """How the points of a test are assigned to the grid points of a model.

    Parameters
    ----------
    structure : of the model
    numbers : (n,) of the test points
    points : (n, 3) their places in the unit of the model; NaN where they have none
    """
    found = _Placed(structure, numbers, points)
    ways = (found.as_they_are, found.by_number_turned, found.turned, found.by_number, found.with_tolerance)
    return next((one for way in ways if (one := way()) is not None), found.nowhere())


class _Placed:
    """Test points and grid points."""

    def __init__(self, structure: Structure, numbers: Integers, points: Reals) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415  slow to import

        nodes = structure.nodes
        self.nodes, self.numbers, self.points = nodes, numbers, points
        self.placed = nodes.has_coordinates and bool(len(points)) and bool(np.isfinite(points).all())
        # export programs write 0, 0, 0 for points without a place
        self.placed &= len(points) < _LEAST_POINTS or bool(np.ptp(points, axis=0).any())
        self.diagonal = float(np.linalg.norm(np.ptp(nodes.xyz, axis=0))) if len(nodes.xyz) else 0.0
        self.tree = cKDTree(nodes.xyz) if len(nodes.xyz) else None
        self.numbered = bool(len(numbers)) and all(nodes.has_grid(int(n)) for n in numbers)

    def _own(self, points: Reals, part: float) -> float | None:
        """Largest distance, where all points lie near grid points of their own; None else."""
        if not self.placed or self.tree is None or not self.diagonal:
            return None
        different = np.unique(points, axis=0)
        distance, at = self.tree.query(different)
        near = distance.max() <= part * self.diagonal and len(set(at.tolist())) == len(different)
        return float(distance.max()) if near else None

    def as_they_are(self) -> GuessedSensors | None:
        """Coordinates of the test are those of the model."""
        distance = self._own(self.points, _TIGHT)
        if distance is None:
            return None
        return GuessedSensors(
            f"each of the {len(self.numbers)} test points lies at a grid point of its own; the largest distance is "
            f"{distance:.2g}"
        )

    def by_number_turned(self) -> GuessedSensors | None:
        """Grid points with the numbers of the test points are a rigid motion of these away."""
        if not (self.placed and self.numbered) or len(self.points) < _LEAST_POINTS or not self.diagonal:
            return None
        grids = self.nodes.xyz[[self.nodes.position(int(n)) for n in self.numbers]]
        rotation, origin, spread = _rigid_motion(self.points, grids)
        moved = self.points @ rotation.T + origin
        distance = float(np.linalg.norm(moved - grids, axis=1).max())
        if distance > _TIGHT * self.diagonal or not spread:
            return None
        return self._with_axes(rotation, origin, "grid points with the numbers of the test points")

    def turned(self) -> GuessedSensors | None:
        """Axes of the test are exchanged, or its origin is another one."""
        if not self.placed or len(self.points) < _LEAST_POINTS:
            return None
        for rotation, origin in self._motions():
            if self._own(self.points @ rotation.T + origin, _TIGHT) is not None:
                return self._with_axes(rotation, origin, "all test points at grid points of their own")
        return None

    def _motions(self) -> Iterator[tuple[Reals, Reals]]:
        middle = _middle(self.nodes.xyz)
        changes = [matrix for _, matrix in axis_changes() if np.linalg.det(matrix) > 0.0]
        yield from ((matrix, np.zeros(3)) for matrix in changes)
        yield from ((matrix, middle - _middle(self.points @ matrix.T)) for matrix in changes)

    def _with_axes(self, rotation: Reals, origin: Reals, fits: str) -> GuessedSensors:
        keys: dict[str, Any] = {}
        clean = np.where(np.abs(rotation - np.round(rotation)) < 1e-9, np.round(rotation), rotation)
        if not np.allclose(clean, np.eye(3), atol=1e-9):
            keys["rotation"] = [[float(x) + 0.0 for x in row] for row in clean]
        shift = np.where(np.abs(origin) <= 1e-9 * self.diagonal, 0.0, origin)
        if shift.any():
            keys["origin"] = [float(f"{x:.9g}") for x in shift]
        differing = [
            word for word, differs in (("the axes", "rotation" in keys), ("the origin", shift.any())) if differs
        ]
        what = " and ".join(differing)
        return GuessedSensors(
            f"{what} of the test differ from those of the model: the motion below puts {fits}",
            {},
            keys,
            (f"check {' and '.join(keys)} of [test] with the pictures of the mode shapes",),
        )

    def by_number(self) -> GuessedSensors | None:
        """Test points have the numbers of grid points."""
        if not self.numbered:
            return None
        words = "each test point has the number of a grid point"
        if not self.placed:
            words += ", and the test has no coordinates, or the same ones for all points"
            return GuessedSensors(words, {"by_id": True})
        grids = self.nodes.xyz[[self.nodes.position(int(n)) for n in self.numbers]]
        ratio = unit_ratio(self.points, grids) if len(self.points) >= _LEAST_POINTS else ""
        doubt = ratio or "the coordinates of the test points are not those of the grid points with their numbers"
        return GuessedSensors(words, {"by_id": True}, {}, (doubt,))

    def with_tolerance(self) -> GuessedSensors | None:
        """Each test point has a grid point of its own, which is not very near."""
        distance = self._own(self.points, _LOOSE)
        if distance is None:
            return None
        tolerance = float(f"{1.05 * distance:.2g}")
        words = f"each test point has a nearest grid point of its own; the largest distance is {distance:.3g}"
        return GuessedSensors(words, {"tolerance": tolerance}, {}, ("the mesh has no grid points at the sensors",))

    def nowhere(self) -> GuessedSensors:
        """No way assigns all."""
        words = "the test points could not be assigned to grid points"
        if not self.placed:
            words += (
                ": the test has no coordinates for them, or the same ones for all, and their numbers are not those of "
                "grid points"
            )
        doubt = "list them in [sensors] nodes = { test point = grid point }, or correct coordinates, units and axes"
        return GuessedSensors(words, {}, {}, (doubt,))


def _middle(points: Reals) -> Reals:
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def _rigid_motion(points: Reals, grids: Reals) -> tuple[Reals, Reals, bool]:
    """Rotation and shift with the least squares of distances (Kabsch 1976); whether the points span a plane."""
    a, b = points - points.mean(axis=0), grids - grids.mean(axis=0)
    U, sizes, Vt = np.linalg.svd(a.T @ b)
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt)) or 1.0])
    rotation = (U @ turn @ Vt).T
    return rotation, grids.mean(axis=0) - rotation @ points.mean(axis=0), bool(sizes[1] > 1e-6 * sizes[0])
