"""Open sections with two flanges: I, I1, CHAN, CHAN1, CHAN2, Z, HAT.

Torsion by walls and their junctions; shear factors and shear centres by thin-wall theory.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from femtune.files.nastran.sections.shape import Properties, Rectangle, Shape, composite, shear_areas
from femtune.files.nastran.sections.torsion import arm, corner, tee, wall


def _i(h: Any, bottom: Any, top: Any, web: Any, bottom_t: Any, top_t: Any) -> Properties:
    """Width and thickness of both flanges, thickness of the web; y from the lower edge."""
    zero, clear, between = 0.0 * h, h - bottom_t - top_t, h - (bottom_t + top_t) / 2.0
    parts = [
        Rectangle(bottom_t / 2.0, zero, bottom_t, bottom),
        Rectangle(h - top_t / 2.0, zero, top_t, top),
        Rectangle(bottom_t + clear / 2.0, zero, clear, web),
    ]
    torsion = wall(clear, web) + tee(web, bottom_t) + tee(web, top_t)
    torsion = torsion + 2.0 * (arm((bottom - web) / 2.0, bottom_t) + arm((top - web) / 2.0, top_t))
    stiff_bottom, stiff_top = bottom_t * bottom**3, top_t * top**3
    centre = bottom_t / 2.0 + between * stiff_top / (stiff_top + stiff_bottom), zero
    points = {"low": (zero, zero), "high": (between, zero)}
    walls = []
    for name, y, width, t in (("low", zero, bottom, bottom_t), ("high", between, top, top_t)):
        points |= {f"{name} left": (y, -width / 2.0), f"{name} right": (y, width / 2.0)}
        walls += [(f"{name} {side}", name, width / 2.0, t) for side in ("left", "right")]
    upright, level = shear_areas(points, [*walls, ("low", "high", between, web)])
    return composite(parts, torsion, upright, level, centre)


def _i1(free: Any, web: Any, clear: Any, h: Any) -> Properties:
    """`free` is the length of a flange beyond the web, both sides together."""
    flange = (h - clear) / 2.0
    return _i(h, free + web, free + web, web, flange, flange)


def _chan(w: Any, h: Any, web: Any, flange: Any) -> Properties:
    """The web at the left; y from the middle, z from the web's left face."""
    zero, free, between, away = 0.0 * h, w - web, h - flange, w - web / 2.0
    parts = [
        Rectangle(zero, web / 2.0, h, web),
        Rectangle(between / 2.0, web + free / 2.0, flange, free),
        Rectangle(-between / 2.0, web + free / 2.0, flange, free),
    ]
    torsion = wall(h - 2.0 * flange, web) + 2.0 * (arm(free, flange) + corner(web, flange))
    behind = 3.0 * away**2 * flange / (6.0 * away * flange + between * web)
    points = {"tip": (-between / 2.0, away), "low": (-between / 2.0, zero), "high": (between / 2.0, zero),
              "end": (between / 2.0, away)}  # fmt: skip
    walls = [("tip", "low", away, flange), ("low", "high", between, web), ("high", "end", away, flange)]
    upright, level = shear_areas(points, walls)
    return composite(parts, torsion, upright, level, (zero, web / 2.0 - behind))


def _chan1(free: Any, web: Any, clear: Any, h: Any) -> Properties:
    return _chan(free + web, h, web, (h - clear) / 2.0)


def _chan2(legs: Any, floor: Any, h: Any, w: Any) -> Properties:
    """A channel on its back, open upwards: CHAN with y and z exchanged."""
    lying = _chan(h, w, floor, legs)
    swapped = {"I1": "I2", "I2": "I1", "K1": "K2", "K2": "K1", "N1": "N2", "N2": "N1"}
    return {role: lying[swapped.get(role, role)] for role in lying}


def _z(free: Any, web: Any, clear: Any, h: Any) -> Properties:
    """The upper flange points to the left, the lower one to the right; y and z from the middle."""
    zero, flange, width = 0.0 * h, (h - clear) / 2.0, free + web
    y, z = (clear + flange) / 2.0, free / 2.0
    parts = [
        Rectangle(zero, zero, clear, web),
        Rectangle(y, -z, flange, width),
        Rectangle(-y, z, flange, width),
    ]
    length = free + web / 2.0
    torsion = wall(clear, web) + 2.0 * (arm(free, flange) + corner(web, flange))
    points = {"tip": (y, -length), "high": (y, zero), "low": (-y, zero), "end": (-y, length)}
    walls = [("tip", "high", length, flange), ("high", "low", 2.0 * y, web), ("low", "end", length, flange)]
    upright, level = shear_areas(points, walls)
    return composite(parts, torsion, upright, level)


def _hat(h: Any, t: Any, w: Any, brim: Any) -> Properties:
    """A plate on two webs with brims outwards, one thickness; y from the plate's middle line, downwards negative."""
    zero, half, deep, out = 0.0 * h, (w - t) / 2.0, h - t, brim + t / 2.0
    webs, edge = h - 2.0 * t, half + (t + brim) / 2.0 - t / 2.0
    parts = [
        Rectangle(zero, zero, t, w),
        *(Rectangle(-(t + webs) / 2.0, side * half, webs, t) for side in (1.0, -1.0)),
        *(Rectangle(-deep, side * edge, t, brim + t) for side in (1.0, -1.0)),
    ]
    torsion = wall(w - 2.0 * t + 2.0 * webs, t) + 2.0 * arm(brim, t) + 4.0 * corner(t, t)
    points = {"tip": (-deep, -half - out), "low": (-deep, -half), "left": (zero, -half), "right": (zero, half),
              "foot": (-deep, half), "end": (-deep, half + out)}  # fmt: skip
    lengths = (out, deep, 2.0 * half, deep, out)
    upright, level = shear_areas(points, [(a, b, x, t) for a, b, x in zip(points, list(points)[1:], lengths)])
    return composite(parts, torsion, upright, level, (_hat_shear_centre(half, deep, out, t), zero))


def _hat_shear_centre(a: Any, c: Any, d: Any, t: Any) -> Any:
    """Height of a hat's shear centre above the middle line of its plate: half width a, depth c, brims d.

    The flow of a transverse shear starts at the tip of a brim; its moment about the plate's middle gives the height.
    """
    at_web = t * d * (a + d / 2.0)
    on_brim = t * ((a + d) * d**2 / 2.0 - d**3 / 6.0)
    on_web = at_web * c + t * a * c**2 / 2.0
    inertia = 2.0 * t * ((a + d) ** 3 / 3.0 + c * a**2)
    return 2.0 * (a * on_web - c * on_brim) / inertia


_I_RULE = "dimensions should be positive, DIM5 + DIM6 less than the height DIM1, the web DIM4 less than both widths"
_STEPS_RULE = "dimensions should be positive, and the height DIM4 greater than the clear height DIM3"


def _steps(free: float, web: float, clear: float, h: float) -> bool:
    return min(free, web, clear) > 0 and h > clear


OPEN_SHAPES: Mapping[str, Shape] = {
    "I": Shape(
        6,
        _i,
        lambda h, bottom, top, web, low, high: min(web, low, high) > 0 and h > low + high and web < min(bottom, top),
        _I_RULE,
    ),
    "I1": Shape(4, _i1, _steps, _STEPS_RULE),
    "CHAN": Shape(
        4,
        _chan,
        lambda w, h, web, flange: min(web, flange) > 0 and h > 2 * flange and w > web,
        "dimensions should be positive, the height DIM2 greater than 2 DIM4 and the width DIM1 greater than DIM3",
    ),
    "CHAN1": Shape(4, _chan1, _steps, _STEPS_RULE),
    "CHAN2": Shape(
        4,
        _chan2,
        lambda legs, floor, h, w: min(legs, floor) > 0 and h > floor and w > 2 * legs,
        "dimensions should be positive, the height DIM3 greater than DIM2 and the width DIM4 greater than 2 DIM1",
    ),
    "Z": Shape(4, _z, _steps, _STEPS_RULE),
    "HAT": Shape(
        4,
        _hat,
        lambda h, t, w, brim: min(t, brim) > 0 and h > 2 * t and w > 2 * t,
        "dimensions should be positive, and height DIM1 and width DIM3 greater than 2 DIM2",
    ),
}


# ----------------------------------------------------------------------------------------------------
# Open sections of two walls: T, T1, T2, L.
#
# Torsion by arms and their junction, shear factors by thin-wall theory; the shear centre is the point where the
# middle lines meet, since the shear flows of all walls pass through it.


def _t(w: Any, h: Any, flange: Any, web: Any, up: float = 1.0) -> Properties:
    """Flange at the top (up = 1) or at the bottom (up = −1); y from the flange's middle line."""
    zero, stem = 0.0 * h, h - flange
    parts = [Rectangle(zero, zero, flange, w), Rectangle(-up * h / 2.0, zero, stem, web)]
    torsion = 2.0 * arm((w - web) / 2.0, flange) + arm(stem, web) + tee(web, flange)
    points = {"left": (zero, -w / 2.0), "right": (zero, w / 2.0), "joint": (zero, zero),
              "foot": (-up * (h - flange / 2.0), zero)}  # fmt: skip
    walls = [("left", "joint", w / 2.0, flange), ("right", "joint", w / 2.0, flange),
             ("joint", "foot", h - flange / 2.0, web)]  # fmt: skip
    upright, level = shear_areas(points, walls)
    return composite(parts, torsion, upright, level, (zero, zero))


def _t1(h: Any, stem: Any, flange: Any, web: Any) -> Properties:
    """An upright flange at the right end of a level web: T2 with y and z exchanged, `stem` beyond the flange."""
    turned = _t(h, stem + flange, flange, web)
    swapped = {"I1": "I2", "I2": "I1", "K1": "K2", "K2": "K1", "N1": "N2", "N2": "N1"}
    return {role: turned[swapped.get(role, role)] for role in turned}


def _l(w: Any, h: Any, level: Any, upright: Any) -> Properties:
    """Corner at the lower left; y and z from where the middle lines meet."""
    zero, free = 0.0 * h, w - upright
    parts = [
        Rectangle((h - level) / 2.0, zero, h, upright),
        Rectangle(zero, w / 2.0, level, free),
    ]
    torsion = arm(free, level) + arm(h - level, upright) + corner(level, upright)
    across, along = w - upright / 2.0, h - level / 2.0
    points = {"right": (zero, across), "corner": (zero, zero), "top": (along, zero)}
    areas = shear_areas(points, [("right", "corner", across, level), ("corner", "top", along, upright)])
    return composite(parts, torsion, *areas, (zero, zero))


def _t2(w: Any, h: Any, flange: Any, web: Any) -> Properties:
    """A T with its flange below."""
    return _t(w, h, flange, web, up=-1.0)


_RULE = "dimensions should be positive, the height DIM2 greater than DIM3 and the width DIM1 greater than DIM4"


def _two_walls(w: float, h: float, level: float, upright: float) -> bool:
    return min(level, upright) > 0 and h > level and w > upright


TEE_SHAPES: Mapping[str, Shape] = {
    "T": Shape(4, _t, _two_walls, _RULE),
    "T2": Shape(4, _t2, _two_walls, _RULE),
    "T1": Shape(
        4,
        _t1,
        lambda h, stem, flange, web: min(stem, flange, web) > 0 and h > web,
        "dimensions should be positive, and the height DIM1 greater than the thickness DIM4",
    ),
    "L": Shape(4, _l, _two_walls, _RULE),
}
