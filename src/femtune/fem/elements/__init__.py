"""Elements, one small file each: a batch in, a list of contributions out."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.fem.elements.kernels import KINDS, contributions, pieces
    from femtune.fem.elements.kind import ElementKernel, ElementKind
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = ["KINDS", "ElementKernel", "ElementKind", "contributions", "pieces"]
