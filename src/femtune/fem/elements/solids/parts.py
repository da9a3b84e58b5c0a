"""Parts of solids in a uniform refinement: eight of half the size; of a pyramid six and four tetrahedra."""

from __future__ import annotations

from femtune.fem.elements.kind import QUADRILATERAL_PARTS, TRIANGLE_PARTS, Corners, ElementPart


def _over(faces: tuple[ElementPart, ...], count: int) -> tuple[ElementPart, ...]:
    """Parts of a prism from those of its lower face with `count` corners; those of the upper face follow in order."""

    def lifted(corners: Corners) -> Corners:
        return tuple(tuple(c + count for c in mean) for mean in corners)

    def between(corners: Corners) -> Corners:
        return tuple((*mean, *(c + count for c in mean)) for mean in corners)

    lower = (ElementPart((*face.corners, *between(face.corners))) for face in faces)
    upper = (ElementPart((*between(face.corners), *lifted(face.corners))) for face in faces)
    return (*lower, *upper)


HEXAHEDRON_PARTS = _over(QUADRILATERAL_PARTS, 4)
PENTAHEDRON_PARTS = _over(TRIANGLE_PARTS, 3)

# four at the corners; the octahedron between them is cut along the line from the middle of side 1-3 to that of 2-4
TETRAHEDRON_PARTS = (
    ElementPart(((0,), (0, 1), (0, 2), (0, 3))),
    ElementPart(((0, 1), (1,), (1, 2), (1, 3))),
    ElementPart(((0, 2), (1, 2), (2,), (2, 3))),
    ElementPart(((0, 3), (1, 3), (2, 3), (3,))),
    ElementPart(((0, 1), (1, 2), (0, 2), (1, 3))),
    ElementPart(((0, 1), (0, 2), (0, 3), (1, 3))),
    ElementPart(((0, 2), (1, 2), (2, 3), (1, 3))),
    ElementPart(((0, 2), (2, 3), (0, 3), (1, 3))),
)


def pyramid_parts(tetrahedron: str) -> tuple[ElementPart, ...]:
    """Pyramids at the five corners, one upside down between them, and a tetrahedron of a kind at each sloping face."""
    base, middles = (0, 1, 2, 3), ((0, 4), (1, 4), (2, 4), (3, 4))
    below = [ElementPart((*face.corners, middles[k])) for k, face in enumerate(QUADRILATERAL_PARTS)]
    # the upside-down one lists its upper square the other way around
    inner = [ElementPart((*middles, (4,))), ElementPart((*reversed(middles), base))]
    sides = ((0, 1), (1, 2), (2, 3), (3, 0))
    beside = [ElementPart(((a, b), base, middles[a], middles[b]), tetrahedron) for a, b in sides]
    return (*below, *inner, *beside)
