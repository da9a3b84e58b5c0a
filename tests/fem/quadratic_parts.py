"""Single solids with mid-side nodes, curved and with nodes missing: what several tests of them share."""

from __future__ import annotations

import numpy as np
from tests.fem.solid_parts import ISO

from femtune.fem.elements.solids.shape import HEXA20_SHAPE as HEXA20
from femtune.fem.elements.solids.shape import PENTA15_SHAPE as PENTA15
from femtune.fem.elements.solids.shape import PYRAM13_SHAPE as PYRAM13
from femtune.fem.elements.solids.shape import TETRA10_SHAPE as TETRA10
from femtune.fem.elements.solids.shape import SolidShape
from structures.shells import Isotropic
from structures.solids import Law, SolidPart, solid_structure

SHAPES: dict[str, SolidShape] = {"hexa20": HEXA20, "penta15": PENTA15, "tetra10": TETRA10, "pyram13": PYRAM13}


def curved(kind: str, size: float = 0.12, seed: int = 1) -> np.ndarray:
    """A distorted element, its sides curved."""
    xyz = SHAPES[kind].nodes
    return xyz + np.random.default_rng(seed).uniform(-size, size, xyz.shape) * (0.5 if kind == "tetra10" else 1.0)


def one(kind: str, xyz: np.ndarray, material: Isotropic | Law = ISO, missing: tuple[int, ...] = (), **settings):
    cell = np.arange(len(xyz))
    cell[list(missing)] = -1
    return solid_structure(xyz, [SolidPart(kind, cell[None], material)], **settings)
