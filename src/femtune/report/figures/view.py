"""Where the eye is: an orthographic view in which structures, tall or flat, can be read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

_AZIMUTH = np.radians(-58.0)
"""Off the isometric angle, so that corners of a square plan do not hide each other."""
_LOW, _HIGH = np.radians(24.0), np.radians(36.0)
"""Elevation for a tall structure, and for one that is flat: wings and plates are looked at from higher up."""
_TALL = 0.5
"""Height over width from which on a structure is tall."""


@dataclass(frozen=True)
class View:
    """From basic coordinates to points of a panel; rows of `axes`: right, up, and towards the eye."""

    axes: Reals
    scale: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)

    def flat(self, points: Reals) -> Reals:
        """(n, 2), y downwards."""
        return np.asarray(points @ self.axes[:2].T * [self.scale, -self.scale] + self.shift)

    def depth(self, points: Reals) -> Reals:
        """(…,) larger where nearer to the eye."""
        return np.asarray(points @ self.axes[2])


def direction(points: Reals) -> View:
    """The direction of view for a structure of these points, (n, 3); z of the basic frame upwards."""
    size = np.ptp(points, axis=0) if len(points) else np.zeros(3)
    width = max(size[0], size[1])
    tall = min(1.0, float(size[2]) / (_TALL * width)) if width > 0.0 else 1.0
    return View(_axes(_HIGH + tall * (_LOW - _HIGH)))


def _axes(elevation: float) -> Reals:
    c, s = np.cos(_AZIMUTH), np.sin(_AZIMUTH)
    up, out = np.sin(elevation), np.cos(elevation)
    return np.array([[-s, c, 0.0], [-up * c, -up * s, out], [out * c, out * s, up]])


def fitted(view: View, parts: Sequence[Reals], width: float, top: float, margin: float) -> tuple[View, float]:
    """The view scaled so that all points fit into a panel of that width, and the height of that panel.

    Parameters
    ----------
    parts : points (n, 3) that must be on the panel
    top : where the panel begins below its title
    margin : left free on all sides
    """
    flat = np.concatenate(parts) @ view.axes[:2].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    size, room = high - low, width - 2 * margin
    # a line along the direction of view has no size on the sheet, and a single point none at all
    least = 1e-9 * size.max() or 1.0
    scale = float(min(room / max(size[0], least), 1.25 * room / max(size[1], least)))
    left = 0.5 * (width - scale * size[0])
    shift = (float(left - scale * low[0]), float(top + margin + scale * high[1]))
    return View(view.axes, scale, shift), float(scale * size[1]) + 2 * margin
