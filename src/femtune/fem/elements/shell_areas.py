"""Areas of shells and shear panels, for mass that is spread over them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.fem.elements.curved_shape import QUAD8_SHAPE, TRI6_SHAPE
from femtune.fem.elements.curved_surface import CurvedNodes
from femtune.fem.structure import ElementBatch, NodeTable

Reals = NDArray[np.float64]

_SHAPES = {"shell-quad8": QUAD8_SHAPE, "shell-tri6": TRI6_SHAPE}


def areas(nodes: NodeTable, batch: ElementBatch) -> Reals:
    """(e,) areas: of a curved surface its own, of a warped quadrilateral that in its mean plane."""
    missing = batch.nodes < 0
    xyz = np.where(missing[:, :, None], 0.0, nodes.xyz[batch.nodes])
    if batch.kind in _SHAPES:
        shape = _SHAPES[batch.kind]
        surface = CurvedNodes(shape, xyz, np.zeros_like(xyz), missing).surface(shape.points)
        return np.asarray(surface.area @ shape.weights)
    one, other = xyz[:, 2] - xyz[:, 0], xyz[:, -1 if xyz.shape[1] > 3 else 0] - xyz[:, 1]
    return 0.5 * np.asarray(np.linalg.norm(np.cross(one, other), axis=1))
