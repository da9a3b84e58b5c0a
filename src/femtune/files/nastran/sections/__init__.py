"""Cross sections of PBARL and PBEAML: properties as functions of the dimensions, with exact derivatives.

The sections are drawn with y upwards and z to the right; plane 1 is the plane of the element's x and y axes, and
I1 = ∫ y² dA is the moment of inertia for bending in it. `docs/theory/beam-sections.md` has drawings and accuracies.
"""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.files.nastran.sections.catalogue import SHAPES
    from femtune.files.nastran.sections.shape import SECTION_ROLES, Shape
    from femtune.files.nastran.sections.torsion import rectangle_torsion
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = ["SECTION_ROLES", "SHAPES", "Shape", "rectangle_torsion"]
