"""Refusals of shells that have no proper shape, thickness or material axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.errors import ErrorCollector
from femtune.fem.elements.placement import element_error, nominal
from femtune.fem.elements.shell_placement import mean_plane, shell_normal
from femtune.fem.structure import ElementBatch, Structure

Reals = NDArray[np.float64]

# a side shorter than this part of the longest one is collapsed
COLLAPSED = 1e-9
# sine of the angle between two sides at a corner below which the corner is straight or reflex
STRAIGHT = 1e-6
# sine of the angle between the normal and a material direction below which its projection means nothing
ALONG_NORMAL = 1e-6
# elements that are shown for each kind of error
SHOWN = 10


def check_shells(batch: ElementBatch, structure: Structure) -> None:
    """Refuse what no shell can be made of.

    Raises
    ------
    FemtuneError : ``element.shell-shape`` (collapsed side, no area, straight or reflex corner),
        ``element.shell-thickness``, ``element.material-direction``; several are shown together
    """
    collector = ErrorCollector()
    xyz = structure.nodes.xyz[batch.nodes]
    bad = check_thickness(batch, structure, collector) | check_shapes(batch, xyz, collector)
    if not bad.all():
        _check_directions(batch, xyz, ~bad, collector)
    collector.raise_if_any()


def check_thickness(batch: ElementBatch, structure: Structure, collector: ErrorCollector) -> NDArray[np.bool_]:
    """Refuse thicknesses that are not positive (``element.shell-thickness``); (e,) which elements have them."""
    t = nominal(batch, structure, "t")
    bad = ~(t > 0.0)
    for i in np.flatnonzero(bad)[:SHOWN]:
        with collector.catch():
            what = f"the shell's thickness is {t[i]:g}"
            raise element_error(batch, int(i), "element.shell-thickness", what, "give a thickness above zero")
    return bad


def check_shapes(batch: ElementBatch, xyz: Reals, collector: ErrorCollector) -> NDArray[np.bool_]:
    """Refuse corners (e, n, 3) that bound no area (``element.shell-shape``); (e,) which elements have them."""
    side = np.linalg.norm(np.roll(xyz, -1, axis=1) - xyz, axis=2)
    longest = side.max(axis=1)
    collapsed = side.min(axis=1) <= COLLAPSED * longest
    flat = np.linalg.norm(shell_normal(xyz), axis=1) <= STRAIGHT * longest**2
    reflex = np.zeros(len(batch), bool)
    sound = ~(collapsed | flat)
    sines = corner_sines(xyz[sound])
    reflex[sound] = (sines <= STRAIGHT).any(axis=1)
    twice, order = (_MOVE, _MOVE) if xyz.shape[1] == 3 else (_TWICE, _ORDER)
    faults = (
        (collapsed, "two neighbouring corners of the shell are at the same place", twice),
        (flat & ~collapsed, "the corners of the shell lie on a line or cross over, so that it has no area", order),
        (reflex, "the shell has a corner with an angle of 180 degrees or more", _ORDER),
    )
    for mask, what, hint in faults:
        for i in np.flatnonzero(mask)[:SHOWN]:
            with collector.catch():
                raise element_error(batch, int(i), "element.shell-shape", what, hint)
    return np.asarray(collapsed | flat | reflex)


_MOVE = "move a grid point, or delete the element"
_TWICE = "a quadrilateral with two corners at one place is a CTRIA3; else move a grid point or delete it"
_ORDER = "list the grid points in order around the element, and move the one that makes the corner"


def corner_sines(xyz: Reals) -> Reals:
    """(m, n) sines of the corner angles on the mean plane; negative at a reflex corner."""
    if not len(xyz):
        return np.zeros(xyz.shape[:2])
    corners = mean_plane(xyz)[1]
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cross = ahead[:, :, 0] * back[:, :, 1] - ahead[:, :, 1] * back[:, :, 0]
    sizes = np.linalg.norm(ahead, axis=2) * np.linalg.norm(back, axis=2)
    return np.asarray(np.divide(cross, sizes, out=np.zeros_like(cross), where=sizes > 0.0))


def _check_directions(batch: ElementBatch, xyz: Reals, sound: NDArray[np.bool_], collector: ErrorCollector) -> None:
    direction = batch.facts["direction"]
    given = np.flatnonzero(sound & direction.any(axis=1))
    if not given.size:
        return
    axes = mean_plane(xyz[given])[0]
    flat = np.einsum("mi,mij->mj", direction[given], axes)[:, :2]
    bad = np.linalg.norm(flat, axis=1) <= ALONG_NORMAL * np.linalg.norm(direction[given], axis=1)
    for i in given[bad][:SHOWN]:
        with collector.catch():
            what = "the x axis of the material's coordinate system is along the shell's normal"
            hint = "choose a system whose x axis has a projection on the element, or give an angle THETA"
            raise element_error(batch, int(i), "element.material-direction", what, hint)
