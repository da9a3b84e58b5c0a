"""ElementKind: everything that is true of all elements of a kind, stated once beside the kind's kernel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from femtune.fem.contribution import Contribution
from femtune.fem.elements.shells.curved_surface import CurvedShape
from femtune.fem.structure import ElementBatch, Structure

ElementKernel = Callable[[ElementBatch, Structure], list[Contribution]]
ElementPieces = Callable[[ElementBatch, Structure], Iterator[list[Contribution]]]
Corners = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class ElementKind:
    """A kind of element: its name in batches, its kernel, and what drawing, refinement and citation need of it.

    Parameters
    ----------
    key : name of the kind, as `ElementBatch.kind` has it
    kernel : the terms of a batch
    pieces : the same, some elements at a time, where the kernel goes through a batch itself
    line : True where the element is drawn as a line between its first two grid points
    faces : faces of a shell by place in the element; −1 for the fourth corner of a triangle
    sides : faces of a solid by its corners; those that no two solids share are drawn
    children : for a uniform refinement, the corners of each part among corners, middles of sides and, for a
        quadrilateral, its middle; empty where an element stays whole
    refinable : True where a refinement knows the kind, whether it is divided or stays whole
    shell : True where the element has normals that it shares with its neighbours
    surface : shape functions of a curved shell; None for other elements
    end_offsets : True where the offsets of its ends can be parameters
    papers : keys of the publications that the element comes from (`femtune.citations`)

    Examples
    --------
    >>> from femtune.fem.elements import KINDS
    >>> KINDS["bar"].line, KINDS["bar"].children
    (True, ((0, 2), (2, 1)))
    """

    key: str
    kernel: ElementKernel
    pieces: ElementPieces | None = None
    line: bool = False
    faces: Corners = ()
    sides: Corners = ()
    children: Corners = ()
    refinable: bool = False
    shell: bool = False
    surface: CurvedShape | None = None
    end_offsets: bool = False
    papers: tuple[str, ...] = ()


KINDS: dict[str, ElementKind] = {}
"""All kinds of elements by their name in batches; `femtune.fem.elements` fills it."""
