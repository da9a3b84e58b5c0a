"""Three structures as mappings of the unit cube, clamped at one face."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Mapped = Callable[[NDArray, NDArray, NDArray], tuple[NDArray, NDArray, NDArray]]


@dataclass(frozen=True)
class Solid:
    """A structure, its clamped face, and meshes from coarse to fine: boxes along u, v, w.

    Parameters
    ----------
    second : meshes of elements with mid-side nodes
    first : meshes of elements without
    """

    name: str
    place: Mapped
    clamped: str
    second: tuple[tuple[int, int, int], ...]
    first: tuple[tuple[int, int, int], ...]


def block(u: NDArray, v: NDArray, w: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """A block 200 × 120 × 80 mm."""
    return 0.2 * u, 0.12 * v, 0.08 * w


def bracket(u: NDArray, v: NDArray, w: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """A quarter ring of radii 50 and 80 mm, 40 mm wide, that thins to 15 mm at its free end."""
    radius = 0.05 + 0.03 * w * (1.0 - 0.5 * u)
    turn = 0.5 * np.pi * u
    return radius * np.cos(turn), radius * np.sin(turn), 0.04 * v


def segment(u: NDArray, v: NDArray, w: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """120 degrees of a cylinder of radius 150 mm, 200 mm long, wall 10 mm."""
    radius, turn = 0.155 - 0.01 * w, 2.0 * np.pi / 3.0 * v
    return radius * np.cos(turn), radius * np.sin(turn), 0.2 * u


SOLIDS = (
    Solid("block", block, "u0", ((3, 2, 2), (6, 4, 3), (10, 6, 4)), ((5, 3, 2), (10, 6, 4), (20, 12, 8))),
    Solid("bracket", bracket, "u0", ((4, 2, 2), (8, 3, 3), (12, 4, 4)), ((8, 3, 2), (16, 6, 4), (24, 9, 8))),
    Solid(
        "cylinder segment", segment, "u0", ((3, 4, 1), (6, 8, 1), (18, 26, 1)), ((6, 8, 1), (12, 16, 1), (24, 32, 2))
    ),
)
