"""Whether sections and coordinates can have the same unit of length.

A bar of thickness h and length L has its first bending frequency at f = κ h c/L² with c = sqrt(E/ρ) and κ between 0.16
(cantilever) and 1.03 (free, or clamped at both ends) for a rectangle, so that f L/c, the lowest frequency in units of
the wave speed over the extent, is about h/L. The second number is known before any mode is solved. Neither needs units.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Reals
from femtune.errors import Notice
from femtune.study.plausible_units import materials_of

if TYPE_CHECKING:
    from femtune.fem.structure import ElementBatch, Structure

LEAST_THICKNESS = 1e-4
"""Thickness of the thickest section over the extent of the elements; no structure has a smaller one."""
LEAST_OF_EDGE = 0.01
"""Thickness of the thickest section over the median length of the elements; a fine mesh of a slender structure, such as
a wire, has more, even if its thickness over the extent is smaller than that of any other structure."""
LARGEST_THICKNESS = 2.0
"""Thickness of the thinnest section over the extent of the elements; no structure has a larger one."""
THIN = 1e-3
"""Thickness over extent below which the frequency of the lowest elastic mode is judged as well: a thick structure may
have low frequencies on soft springs. A ruler of 1 mm and 0.5 m has 2e-3."""
LEAST_FREQUENCY = 3e-5
"""f L/c of the lowest elastic mode; no thin structure has a smaller one. The ruler, clamped at one end, has 3e-4."""


def section_notices(structure: Structure) -> tuple[Notice, ...]:
    """``deck.sections-doubtful`` if all sections are far too thin, or one is far too thick, for the coordinates."""
    sizes = section_sizes(structure)
    if sizes is None:
        return ()
    thickness, least, extent = sizes
    if thickness < LEAST_THICKNESS * extent and thickness < LEAST_OF_EDGE * _median_edge(structure):
        return (Notice("deck.sections-doubtful", thickness=thickness, extent=extent, ratio=thickness / extent),)
    if least > LARGEST_THICKNESS * extent:
        return (Notice("deck.sections-doubtful/thick", thickness=least, extent=extent, ratio=least / extent),)
    return ()


def slow_modes(structure: Structure, freq_hz: float) -> tuple[Notice, ...]:
    """``deck.sections-doubtful/slow`` if the lowest elastic frequency is too low for materials, extent and sections."""
    sizes = section_sizes(structure)
    speeds = [(m.modulus / m.density) ** 0.5 for m in materials_of(structure)]
    if sizes is None or not speeds or section_notices(structure):
        return ()
    thickness, _, extent = sizes
    ratio = freq_hz * extent / max(speeds)
    if thickness >= THIN * extent or ratio >= LEAST_FREQUENCY:
        return ()
    facts = {"freq_hz": freq_hz, "thickness": thickness, "extent": extent, "ratio": ratio}
    return (Notice("deck.sections-doubtful/slow", **facts),)


def section_sizes(structure: Structure) -> tuple[float, float, float] | None:
    """Largest thickness, its lower bound, and extent of the elements with sections.

    The thickness of a bar is the larger one of sqrt(A) and sqrt(12 I/A), the height of a rectangle with this A and I;
    the lower bound is the smaller one, since an A or I that shall have no effect is given a large value. None if there
    are solids, which have no sections, or if there is no section or no extent.
    """
    sized = [(size, b) for b in structure.batches if (size := _sizes(structure, b))]
    if not sized or not structure.nodes.has_coordinates or any("C11" in b.roles for b in structure.batches):
        return None
    at = np.unique(np.concatenate([b.nodes.ravel() for _, b in sized]))
    extent = float(np.linalg.norm(np.ptp(structure.nodes.xyz[at[at >= 0]], axis=0)))
    thickness, least = (max(size[i] for size, _ in sized) for i in (0, 1))
    return (thickness, least, extent) if extent and thickness else None


def _median_edge(structure: Structure) -> float:
    """Median distance of the first two points of the elements with sections."""
    ends = [b.nodes[:, :2] for b in structure.batches if b.nodes.shape[1] > 1 and _sizes(structure, b)]
    xyz = structure.nodes.xyz[np.concatenate(ends)]
    return float(np.median(np.linalg.norm(xyz[:, 1] - xyz[:, 0], axis=1)))


def _sizes(structure: Structure, batch: ElementBatch) -> tuple[float, float] | None:
    """The largest thickness and its lower bound of a batch; None for elements without sections."""
    values = np.asarray(structure.values.values)

    def of(*roles: str) -> Reals:
        return np.max([np.abs(values[batch.roles[role]]) for role in roles], axis=0)

    if "t" in batch.roles:
        return float(of("t").max()), float(of("t").max())
    end = next((end for end in ("", "@0") if f"A{end}" in batch.roles), None)
    if end is None:
        return None
    area = of(f"A{end}")
    root_area = float(np.sqrt(area.max()))
    if f"I1{end}" not in batch.roles:
        return root_area, root_area
    heights = 12.0 * of(f"I1{end}", f"I2{end}") / np.where(area > 0.0, area, np.inf)
    height = float(np.sqrt(heights.max()))
    return max(root_area, height), min(root_area, height)
