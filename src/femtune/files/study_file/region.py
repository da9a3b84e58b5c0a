"""`region` of a parameter: which elements it moves, by what they are made of and where they lie."""

from __future__ import annotations

from femtune.files.study_file.kinds import Elements, Number, Positive, Vector
from femtune.files.study_file.table import Table


class NearTable(Table):
    """A ball about a point, a grid point, or the middle of an element (a joint)."""

    distance: Positive
    point: Vector | None = None
    node: Number | None = None
    element: Number | None = None


class RegionTable(Table):
    """Conditions that hold together; an element lies where its centre lies."""

    elements: Elements | None = None
    properties: Elements | None = None
    materials: Elements | None = None
    set: Number | None = None
    box: tuple[Vector, Vector] | None = None
    near: NearTable | None = None
