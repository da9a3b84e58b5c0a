"""ElementKind: all properties of a kind of element, stated once beside its kernel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from femtune.fem.contribution import Contribution
from femtune.fem.elements.differential import Differential
from femtune.fem.elements.shells.curved_surface import CurvedShape
from femtune.fem.elements.solids.shape import SolidShape
from femtune.fem.structure import ElementBatch, Structure

ElementKernel = Callable[[ElementBatch, Structure], list[Contribution]]
ElementPieces = Callable[[ElementBatch, Structure], Iterator[list[Contribution]]]
DifferentialKernel = Callable[[ElementBatch, Structure], Differential]
Corners = tuple[tuple[int, ...], ...]


class ElementPart(NamedTuple):
    """One part of a divided element: each of its corners is the mean of some corners of the element.

    Parameters
    ----------
    corners : for each corner of the part, the corners of the element whose mean it is
    kind : key of the part's kind; "" for that of the element
    """

    corners: Corners
    kind: str = ""


@dataclass(frozen=True)
class ElementKind:
    """A kind of element: its name in batches, its kernel, and what drawing, refinement and citation need of it.

    Parameters
    ----------
    key : name of the kind, as in `ElementBatch.kind`
    kernel : the terms of a batch
    pieces : the same, some elements at a time, for kernels that divide a batch themselves
    line : True where the element is drawn as a line between its first two grid points
    faces : faces of a shell by place in the element; −1 for the fourth corner of a triangle
    sides : faces of a solid by its corners; those that belong to one solid only are drawn
    children : parts of the element in a uniform refinement; empty if the element is not divided
    shell : True where the element has normals that it shares with its neighbours
    surface : shape functions of a curved shell; None for other elements
    volume : shape functions of a solid with mid-side nodes; None for other elements
    end_offsets : True where the offsets of its ends can be parameters
    differential : differential stiffness of a batch; None for elements without one
    papers : keys of the publications that the element comes from (`femtune.citations`)

    Examples
    --------
    >>> from femtune.fem.elements import KINDS
    >>> KINDS["bar"].line, [part.corners for part in KINDS["bar"].children]
    (True, [((0,), (0, 1)), ((0, 1), (1,))])
    """

    key: str
    kernel: ElementKernel
    pieces: ElementPieces | None = None
    line: bool = False
    faces: Corners = ()
    sides: Corners = ()
    children: tuple[ElementPart, ...] = ()
    shell: bool = False
    surface: CurvedShape | None = None
    volume: SolidShape | None = None
    end_offsets: bool = False
    differential: DifferentialKernel | None = None
    papers: tuple[str, ...] = ()


BAR_PARTS = (ElementPart(((0,), (0, 1))), ElementPart(((0, 1), (1,))))
TRIANGLE_PARTS = (
    ElementPart(((0,), (0, 1), (0, 2))),
    ElementPart(((0, 1), (1,), (1, 2))),
    ElementPart(((0, 2), (1, 2), (2,))),
    # its first side is parallel to that of the element, so that material angles remain valid
    ElementPart(((1, 2), (0, 2), (0, 1))),
)
_ALL_CORNERS = (0, 1, 2, 3)
QUADRILATERAL_PARTS = (
    ElementPart(((0,), (0, 1), _ALL_CORNERS, (0, 3))),
    ElementPart(((0, 1), (1,), (1, 2), _ALL_CORNERS)),
    ElementPart((_ALL_CORNERS, (1, 2), (2,), (2, 3))),
    ElementPart(((0, 3), _ALL_CORNERS, (2, 3), (3,))),
)
"""Parts of lines and surfaces, in the order of the element's corners."""


KINDS: dict[str, ElementKind] = {}
"""All kinds of elements by their name in batches; `femtune.fem.elements` fills it."""
