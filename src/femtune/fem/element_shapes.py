"""Badly shaped elements: the tests and usual default limits of Nastran's GEOMCHECK statement.

Shells are measured by their corners, also those with mid-side grid points. Sources: the measures are those of GEOMCHECK
in the MSC Nastran Quick Reference Guide, which also lets a mid-side grid point lie anywhere between the quarter points
of its side (EPLR); aspect ratios of shells, and the limits of EPLR, EPIA (30 degrees from straight) and WARP of solids
(45 degrees), are those of the Autodesk Nastran Reference Manual. All other limits are the usual defaults of GEOMCHECK.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.fem.elements import KINDS
from femtune.fem.elements.kind import ElementKind
from femtune.fem.elements.shells.placement import mean_plane
from femtune.fem.elements.solids.shape import SolidPoints, reference_sides, tabulated
from femtune.fem.structure import ElementBatch, Structure

Measures = dict[str, Reals]
"""(e,) values by the key of a test; NaN where a test does not apply."""
MOST_LISTED = 10
"""Number of the worst elements that a test lists; more would not fit on a page."""


@dataclass(frozen=True)
class ShapeTest:
    """One test.

    Parameters
    ----------
    key : as GEOMCHECK names it: "Q4_SKEW"
    meaning : what is measured
    limit : default
    least : True if the limit is a lower one, False if it is an upper one
    unit : "deg" or ""
    """

    key: str
    meaning: str
    limit: float
    least: bool
    unit: str = ""

    def beyond(self, values: Reals, limit: float) -> np.ndarray:
        """(e,) which values exceed the limit; zero itself exceeds a limit of zero, as such a Jacobian is degenerate."""
        if not self.least:
            return np.asarray(values > limit)
        return np.asarray(values <= limit if limit == 0.0 else values < limit)

    def badness(self, values: Reals) -> Reals:
        """Sort key that puts the worst first."""
        return values if self.least else -values


_ANGLE = "deg"
_SOLIDS = {"TET": "tetrahedron", "HEX": "hexahedron", "PEN": "pentahedron", "PYR": "pyramid"}


def _of_solids(key: str, name: str) -> Iterator[ShapeTest]:
    longest = "longest side over shortest height" if key == "TET" else "longest over shortest side"
    yield ShapeTest(f"{key}_AR", f"{name}: {longest}", 100.0, False)
    parts = "shorter part of a side at its middle grid point over half of the side"
    yield ShapeTest(f"{key}_EPLR", f"{name}: {parts}", 0.5, True)
    yield ShapeTest(f"{key}_EPIA", f"{name}: angle of a side at its middle grid point", 150.0, True, _ANGLE)
    yield ShapeTest(f"{key}_DETJ", f"{name}: smallest over largest Jacobian determinant at the grid points", 0.0, True)
    if key != "TET":
        yield ShapeTest(f"{key}_WARP", f"{name}: cosine between normals at opposite corners of a face", 0.707, True)


TESTS: dict[str, ShapeTest] = {
    test.key: test
    for test in (
        ShapeTest("Q4_SKEW", "quadrilateral: angle between the lines that join midpoints of opposite sides", 30.0, True,
                  _ANGLE),
        ShapeTest("Q4_TAPER", "quadrilateral: area of a corner's triangle over half of the area, minus 1", 0.5, False),
        ShapeTest("Q4_WARP", "quadrilateral: distance of corners from the mean plane over mean diagonal", 0.05, False),
        ShapeTest("Q4_IAMIN", "quadrilateral: smallest angle", 30.0, True, _ANGLE),
        ShapeTest("Q4_IAMAX", "quadrilateral: largest angle", 150.0, False, _ANGLE),
        ShapeTest("Q4_AR", "quadrilateral: longest over shortest side", 100.0, False),
        ShapeTest("T3_SKEW", "triangle: smallest angle", 10.0, True, _ANGLE),
        ShapeTest("T3_IAMAX", "triangle: largest angle", 160.0, False, _ANGLE),
        ShapeTest("T3_AR", "triangle: longest over shortest side", 100.0, False),
        *(test for key, name in _SOLIDS.items() for test in _of_solids(key, name)),
        ShapeTest("BAR_OFF", "CBAR: change of length by offsets over length", 0.15, False),
        ShapeTest("BEAM_OFF", "CBEAM: change of length by offsets over length", 0.15, False),
    )
}  # fmt: skip
"""All tests by their key, with the default limits."""


@dataclass(frozen=True)
class ShapeFound:
    """Result of a test.

    Parameters
    ----------
    test, limit : the test and the limit that was used
    tested, beyond : numbers of elements
    cards, ids, values : of the worst elements beyond the limit, worst first, at most ``MOST_LISTED``
    extreme : the worst value of all elements
    """

    test: ShapeTest
    limit: float
    tested: int
    beyond: int
    cards: tuple[str, ...]
    ids: tuple[int, ...]
    values: tuple[float, ...]
    extreme: float


def element_shapes(
    structure: Structure, limits: Mapping[str, float] | None = None, off: Collection[int] = ()
) -> tuple[ShapeFound, ...]:
    """Every test that applies to some element, in the order of ``TESTS``.

    Parameters
    ----------
    limits : limits in place of the default ones, by key
    off : numbers of elements that are left out

    Examples
    --------
    >>> from femtune.testing import example_deck
    >>> from femtune.files.nastran import read_deck
    >>> from femtune.files.nastran.build import build_structure
    >>> [f.test.key for f in element_shapes(build_structure(read_deck(example_deck())).structure)]
    ['BAR_OFF']
    """
    given = limits or {}
    measured: dict[str, list[tuple[ElementBatch, Reals]]] = {}
    for batch in structure.batches:
        for key, values in _measures(batch, structure).items():
            keep = np.where(np.isin(batch.ids, list(off)), np.nan, values) if off else values
            if np.isfinite(keep).any():
                measured.setdefault(key, []).append((batch, keep))
    return tuple(
        _found(test, given.get(key, test.limit), measured[key]) for key, test in TESTS.items() if key in measured
    )


def _found(test: ShapeTest, limit: float, parts: list[tuple[ElementBatch, Reals]]) -> ShapeFound:
    ids, values = np.concatenate([b.ids for b, _ in parts]), np.concatenate([v for _, v in parts])
    cards = np.concatenate([np.repeat(b.card, len(b)) for b, _ in parts])
    known = np.isfinite(values)
    ids, values, cards = ids[known], values[known], cards[known]
    order = np.lexsort((ids, test.badness(values)))
    out = order[test.beyond(values[order], limit)]
    worst = out[:MOST_LISTED]
    return ShapeFound(
        test, limit, len(ids), len(out), tuple(map(str, cards[worst])), tuple(map(int, ids[worst])),
        tuple(map(float, values[worst])), float(values[order[0]]),
    )  # fmt: skip


def _measures(batch: ElementBatch, structure: Structure) -> Measures:
    kind = KINDS[batch.kind]
    if not structure.nodes.has_coordinates or not len(batch):
        return {}
    if kind.shell:
        n = 3 if kind.faces[0][-1] < 0 and (kind.surface is None or kind.surface.corners == 3) else 4
        xyz = structure.nodes.xyz[batch.nodes[:, :n]]
        return triangles(xyz) if n == 3 else quadrilaterals(xyz)
    if kind.sides:
        missing = batch.nodes < 0
        return _solids(kind, np.where(missing[:, :, None], np.nan, structure.nodes.xyz[batch.nodes]))
    return _offsets(batch, structure) if kind.end_offsets else {}


def quadrilaterals(xyz: Reals) -> Measures:
    """Of quadrilaterals with corners (e, 4, 3)."""
    _, flat, heights = mean_plane(xyz)
    ahead, back = np.roll(flat, -1, axis=1) - flat, np.roll(flat, 1, axis=1) - flat
    cross = ahead[..., 0] * back[..., 1] - ahead[..., 1] * back[..., 0]
    angles = np.degrees(np.mod(np.arctan2(cross, np.sum(ahead * back, axis=2)), 2.0 * np.pi))
    # the four triangles at the corners cover the area twice
    half = 0.125 * cross.sum(axis=1)
    middles = 0.5 * (flat + np.roll(flat, -1, axis=1))
    one, two = middles[:, 2] - middles[:, 0], middles[:, 3] - middles[:, 1]
    diagonals = [np.linalg.norm(xyz[:, k + 2] - xyz[:, k], axis=1) for k in (0, 1)]
    return {
        "Q4_SKEW": _acute(one, two),
        "Q4_TAPER": np.abs(0.5 * cross / half[:, None] - 1.0).max(axis=1),
        "Q4_WARP": np.abs(heights).max(axis=1) / (0.5 * (diagonals[0] + diagonals[1])),
        "Q4_IAMIN": angles.min(axis=1),
        "Q4_IAMAX": angles.max(axis=1),
        "Q4_AR": _ratio(np.linalg.norm(np.roll(xyz, -1, axis=1) - xyz, axis=2)),
    }


def triangles(xyz: Reals) -> Measures:
    """Of triangles with corners (e, 3, 3)."""
    ahead, back = np.roll(xyz, -1, axis=1) - xyz, np.roll(xyz, 1, axis=1) - xyz
    angles = _angle(ahead, back)
    sides = np.linalg.norm(ahead, axis=2)
    return {"T3_SKEW": angles.min(axis=1), "T3_IAMAX": angles.max(axis=1), "T3_AR": _ratio(sides)}


def _angle(one: Reals, two: Reals) -> Reals:
    """(…,) angles in degrees between vectors (…, 3)."""
    return np.asarray(np.degrees(np.arctan2(np.linalg.norm(np.cross(one, two), axis=-1), np.sum(one * two, axis=-1))))


def _acute(one: Reals, two: Reals) -> Reals:
    """(e,) acute angles in degrees between lines (e, 2)."""
    cross = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    return np.asarray(np.degrees(np.arctan2(np.abs(cross), np.abs(np.sum(one * two, axis=1)))))


def _ratio(lengths: Reals) -> Reals:
    """(e,) largest over smallest of lengths (e, n)."""
    return np.asarray(lengths.max(axis=1) / lengths.min(axis=1))


# ----------------------------------------------------------------------------------------------------
# Solids.


_KEYS: dict[int, str] = {4: "TET", 5: "PYR", 6: "PEN", 8: "HEX"}


def _solids(kind: ElementKind, xyz: Reals) -> Measures:
    """Of solids with nodes (e, n, 3), NaN for mid-side nodes that are left out."""
    faces = [[c for c in face if c >= 0] for face in kind.sides]
    count = 1 + max(c for face in faces for c in face)
    key, corners = _KEYS[count], xyz[:, :count]
    pairs = {tuple(sorted(p)) for face in faces for p in zip(face, [*face[1:], face[0]])}
    one, two = np.array(sorted(pairs)).T
    lengths = np.linalg.norm(corners[:, one] - corners[:, two], axis=2)
    out = {f"{key}_AR": _ratio(lengths), f"{key}_DETJ": _jacobians(kind, xyz, faces, count)}
    if key == "TET":
        volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
        a, b, c = (corners[:, [f[k] for f in faces]] for k in range(3))
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=2)
        with np.errstate(divide="ignore"):
            out["TET_AR"] = lengths.max(axis=1) * areas.max(axis=1) / volume
    else:
        out[f"{key}_WARP"] = np.min([_warp(corners[:, f]) for f in faces if len(f) == 4], axis=0)
    if kind.volume is not None:
        out |= {f"{key}_{name}": v for name, v in _middles(xyz, np.array(kind.volume.edges), count).items()}
    return out


def _warp(face: Reals) -> Reals:
    """(e,) smallest cosine between the normals at opposite corners of faces (e, 4, 3)."""
    normals = np.cross(np.roll(face, -1, axis=1) - face, np.roll(face, 1, axis=1) - face)
    normals = normals / np.linalg.norm(normals, axis=2, keepdims=True)
    cosines = np.sum(normals[:, :2] * normals[:, 2:], axis=2)
    return np.asarray(cosines.min(axis=1))


def _middles(xyz: Reals, edges: Integers, count: int) -> Measures:
    """Positions along the sides and angles at the mid-side nodes; NaN where an element has none."""
    middles = xyz[:, count:]
    one, two = xyz[:, edges[:, 0]] - middles, xyz[:, edges[:, 1]] - middles
    side = two - one
    # fraction of the side between its first corner and the foot of the middle grid point
    along = -np.sum(one * side, axis=2) / np.sum(side**2, axis=2)
    missing = np.isnan(along)
    none = missing.all(axis=1)
    parts = np.where(missing, np.inf, 2.0 * np.minimum(along, 1.0 - along)).min(axis=1)
    angles = np.where(missing, np.inf, _angle(one, two)).min(axis=1)
    return {"EPLR": np.where(none, np.nan, parts), "EPIA": np.where(none, np.nan, angles)}


def _jacobians(kind: ElementKind, xyz: Reals, faces: list[list[int]], count: int) -> Reals:
    """(e,) ratio of the smallest to the largest determinant at the nodes; corners only without mid-side nodes."""
    if kind.volume is not None:
        shape = kind.volume
        # at the apex of a pyramid the determinant vanishes
        places = shape.nodes[shape.nodes[:, 2] < 1.0] if count == 5 else shape.nodes
        sides = reference_sides(tabulated(shape, SolidPoints(places, np.ones(len(places)))), xyz)
        values = np.linalg.det(sides)
    else:
        values = np.stack([_corner(xyz, faces, c) for c in range(4 if count == 5 else count)], axis=1)
    largest = np.abs(values).max(axis=1)
    return np.asarray(values.min(axis=1) / np.where(largest > 0.0, largest, 1.0))


def _corner(xyz: Reals, faces: list[list[int]], corner: int) -> Reals:
    """(e,) volume spanned by the three sides at a corner, positive if the element is not inside out.

    Faces list their corners anticlockwise as seen from outside: in each, the side before and the side after a corner
    follow each other in the order of a right-handed system.
    """
    following: dict[int, int] = {}
    for face in faces:
        if corner in face:
            k = face.index(corner)
            following[face[k - 1]] = face[(k + 1) % len(face)]
    first = next(iter(following))
    second = following[first]
    third = following[second]
    a, b, c = (xyz[:, k] - xyz[:, corner] for k in (first, second, third))
    return np.asarray(np.sum(np.cross(a, b) * c, axis=1))


# ----------------------------------------------------------------------------------------------------
# Offsets of bars.


def _offsets(batch: ElementBatch, structure: Structure) -> Measures:
    ends = structure.nodes.xyz[batch.nodes[:, 1]] - structure.nodes.xyz[batch.nodes[:, 0]]
    shifted = ends + batch.facts["offset_b"] - batch.facts["offset_a"]
    length = np.linalg.norm(ends, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.abs(np.linalg.norm(shifted, axis=1) / length - 1.0)
    return {"BAR_OFF" if batch.card == "CBAR" else "BEAM_OFF": change}
