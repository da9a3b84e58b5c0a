"""Labels of units as programs for tests write them: what "g/N", "(m/s²)/N" or "µm/s2" mean."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from femtune.units import POUND_FORCE

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of gravity in m/s², exact by definition: one g, and kgf/kg."""
_INCH = 0.0254
"""Inch in m, exact by definition."""
_POUND_MASS = 0.45359237
"""Avoirdupois pound in kg, exact by definition."""

Dimension = tuple[int, int, int]
"""Exponents of length, force and time. Mass is force·time²/length; angles and counts have none."""

# exponents of length, force and time
_NONE = (0, 0, 0)
_LENGTH = (1, 0, 0)
_FORCE = (0, 1, 0)
_TIME = (0, 0, 1)
_ACCELERATION = (1, 0, -2)
_RATE = (0, 0, -1)
_MASS = (-1, 1, 2)
PRESSURE = (-2, 1, 0)
_MOMENT = (1, 1, 0)

_UNITS: dict[str, tuple[float, Dimension]] = {
    "m": (1.0, _LENGTH), "km": (1e3, _LENGTH), "cm": (1e-2, _LENGTH), "mm": (1e-3, _LENGTH), "µm": (1e-6, _LENGTH),
    "um": (1e-6, _LENGTH), "micron": (1e-6, _LENGTH), "nm": (1e-9, _LENGTH), "pm": (1e-12, _LENGTH),
    "in": (_INCH, _LENGTH), "mil": (1e-3 * _INCH, _LENGTH), "thou": (1e-3 * _INCH, _LENGTH),
    "ft": (12.0 * _INCH, _LENGTH),
    "N": (1.0, _FORCE), "kN": (1e3, _FORCE), "MN": (1e6, _FORCE), "mN": (1e-3, _FORCE),
    "µN": (1e-6, _FORCE), "uN": (1e-6, _FORCE), "daN": (10.0, _FORCE),
    "dyn": (1e-5, _FORCE), "kgf": (STANDARD_GRAVITY, _FORCE), "kp": (STANDARD_GRAVITY, _FORCE),
    "gf": (1e-3 * STANDARD_GRAVITY, _FORCE), "lbf": (POUND_FORCE, _FORCE), "ozf": (POUND_FORCE / 16.0, _FORCE),
    "tf": (1e3 * STANDARD_GRAVITY, _FORCE), "kip": (1e3 * POUND_FORCE, _FORCE),
    "pdl": (_POUND_MASS * 12.0 * _INCH, _FORCE),
    "s": (1.0, _TIME), "ms": (1e-3, _TIME), "µs": (1e-6, _TIME), "us": (1e-6, _TIME), "ns": (1e-9, _TIME),
    "min": (60.0, _TIME),
    "g": (STANDARD_GRAVITY, _ACCELERATION), "mg": (1e-3 * STANDARD_GRAVITY, _ACCELERATION),
    "µg": (1e-6 * STANDARD_GRAVITY, _ACCELERATION), "ug": (1e-6 * STANDARD_GRAVITY, _ACCELERATION),
    "gal": (1e-2, _ACCELERATION), "mgal": (1e-5, _ACCELERATION),
    "ips": (_INCH, (1, 0, -1)),
    "kg": (1.0, _MASS), "t": (1e3, _MASS), "lbm": (_POUND_MASS, _MASS), "slug": (POUND_FORCE / (12.0 * _INCH), _MASS),
    "Pa": (1.0, PRESSURE), "kPa": (1e3, PRESSURE), "MPa": (1e6, PRESSURE), "bar": (1e5, PRESSURE),
    "psi": (POUND_FORCE / _INCH**2, PRESSURE), "Nm": (1.0, _MOMENT), "kNm": (1e3, _MOMENT),
    "Hz": (1.0, _RATE), "kHz": (1e3, _RATE), "MHz": (1e6, _RATE), "mHz": (1e-3, _RATE),
    "rpm": (1.0 / 60.0, _RATE), "krpm": (1e3 / 60.0, _RATE), "cpm": (1.0 / 60.0, _RATE),
    "rad": (1.0, _NONE), "deg": (math.pi / 180.0, _NONE), "°": (math.pi / 180.0, _NONE),
    "strain": (1.0, _NONE), "µstrain": (1e-6, _NONE), "1": (1.0, _NONE),
}  # fmt: skip
_GRAM = (1e-3, _MASS)
_SPELLINGS = {
    "metre": "m", "meter": "m", "millimetre": "mm", "millimeter": "mm", "micrometre": "µm", "micrometer": "µm",
    "microns": "µm", "inch": "in", "inches": "in", '"': "in", "mils": "mil", "foot": "ft", "feet": "ft",
    "newton": "N", "newtons": "N", "lb": "lbf", "lbs": "lbf", "pound": "lbf", "pounds": "lbf", "kips": "kip",
    "kipf": "kip", "klbf": "kip", "tonf": "tf", "dyne": "dyn", "dynes": "dyn", "pond": "gf",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "millis": "ms", "usec": "µs", "microsecond": "µs", "microseconds": "µs", "micros": "µs", "nsec": "ns",
    "nanosecond": "ns", "nanoseconds": "ns", "minute": "min", "minutes": "min",
    "g's": "g", "gs": "g", "g’s": "g", "gn": "g", "g_n": "g", "gee": "g", "g0": "g", "gravity": "g", "grms": "g",
    "galileo": "gal", "hertz": "Hz", "kilohertz": "kHz", "cps": "Hz", "cycles": "1", "cycle": "1", "rev": "1", "u": "1",
    "r": "1", "radian": "rad", "radians": "rad", "rads": "rad", "degree": "deg", "degrees": "deg", "ustrain": "µstrain",
    "microstrain": "µstrain", "µe": "µstrain", "ue": "µstrain", "tonne": "t", "n.m": "Nm", "n-m": "Nm",
}  # fmt: skip
_WORDS_BEHIND = re.compile(r"[\s_-]*[(\[]?\b(rms|peak|pk|0-pk|0-peak|zero-peak)\b[)\]]?", re.IGNORECASE)
"""Words of scaling behind a unit; in a ratio of motion and force they cancel."""
_TOKEN = re.compile(
    r"\s*(?:(?P<open>\()|(?P<close>\))|(?P<per>/|\bper\b)|(?P<times>\*\*(?=\D)|[*·×]|\.(?=\D)|-(?=[a-zA-Zµ]))"
    r"|(?P<unit>[gG]['’][sS]|[a-zA-Zµ°\"_’]+0?(?![a-zA-Z])|1(?!\d))(?P<power>(?:\^|\*\*)?\s*[-+]?\d+|(?:\^|\*\*)\([-+]?\d+\))?)"
)
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
EMPTY = ("", "none", "null", "n/a", "na", "-", "unknown", "no unit", "unitless", "[-]", "undefined", "general")
"""Labels that say nothing, in small letters."""
_LARGEST_POWER = 4
"""Largest exponent, and depth of brackets, of a unit; no unit of vibration has more (m⁴ of a second moment of area)."""


@dataclass(frozen=True)
class UnitLabel:
    """A label that was understood.

    Parameters
    ----------
    text : the label
    factor : size of one such unit in m, N and s
    dimension : exponents of length, force and time
    """

    text: str
    factor: float
    dimension: Dimension

    @property
    def motion(self) -> str | None:
        """Displacement, velocity or acceleration, of a label of motion; None of another one."""
        return _MOTIONS.get(self.dimension)

    @property
    def is_force(self) -> bool:
        """True for a force."""
        return self.dimension == _FORCE


_MOTIONS = {(1, 0, 0): "displacement", (1, 0, -1): "velocity", _ACCELERATION: "acceleration"}


def says_nothing(text: str) -> bool:
    """True for an empty label and words such as NONE."""
    return text.strip().lower() in EMPTY


def unit_label(text: str) -> UnitLabel | None:
    """The unit that a label means, None for one that is not understood.

    `g` is the acceleration of gravity and not a gram, as in all programs for vibration tests. Letters count in the case
    in which they are written, if they mean anything so: `mN` and `MN` differ, `M/S2` is m/s².

    Examples
    --------
    >>> from femtune.unit_labels import unit_label
    >>> unit_label("µm/s2").factor, unit_label("(m/s²)/N").dimension
    (1e-06, (1, -1, -2))
    """
    return next(iter(meanings(text)), None)


def meanings(text: str) -> list[UnitLabel]:
    """All that a label can mean, the usual meaning first: g is a gram in `g.cm/s2`, and N/m.s may be (N/m)·s."""
    plain = re.sub(r"[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+", lambda m: "^" + m[0].translate(_SUPERSCRIPTS), text.strip())
    plain = _WORDS_BEHIND.sub("", plain.replace("μ", "µ"))
    plain = re.sub(r"[\[{]([^\[\]{}]*)[\]}]", r"(\1)", plain).strip()
    plain = re.sub(r"\s*\^\s*", "^", plain)
    # metres and seconds run together; "ms" alone is a millisecond
    plain = re.sub(r"(?<![a-zA-Zµ])([kcmµu]?m)s\^?-([12])(?!\d)", r"\1.s^-\2", plain)
    if says_nothing(plain):
        return []
    parsed = [_Parser(plain, *way).whole() for way in ((True, False), (False, False), (True, True), (False, True))]
    return [UnitLabel(text.strip(), *label) for label in dict.fromkeys(parsed) if label is not None]


def frequency_factor(text: str) -> float | None:
    """Hz in one unit of a frequency axis, None for a label that is no unit of frequency.

    Examples
    --------
    >>> from femtune.unit_labels import frequency_factor
    >>> round(frequency_factor("rad/s"), 6), frequency_factor("rpm") * 60
    (0.159155, 1.0)
    """
    plain = text.strip().strip("[]").lower()
    label = unit_label(text)
    if label is None or label.dimension != _RATE:
        return None
    angular = "rad" in plain or "deg" in plain or "°" in plain
    return label.factor / (2.0 * math.pi) if angular else label.factor


def time_factor(text: str) -> float | None:
    """Seconds in one unit of a time axis, None for a label that is no unit of time."""
    label = unit_label(text)
    return label.factor if label is not None and label.dimension == _TIME else None


class _Parser:
    """Products, quotients, brackets and powers; a quotient of several is read from the left: a/b/c is a/(b·c).

    Parameters
    ----------
    joined : what follows a solidus belongs to the denominator up to the end: a/b·c is a/(b·c)
    gram : g is a gram
    """

    def __init__(self, text: str, joined: bool, gram: bool) -> None:
        self.text, self.joined, self.gram, self.position = text, joined, gram, 0

    def whole(self) -> tuple[float, Dimension] | None:
        product = self._product(0)
        return product if product is not None and self.position == len(self.text.rstrip()) else None

    def _product(self, depth: int) -> tuple[float, Dimension] | None:
        factor, dimension, sign, first, operator = 1.0, _NONE, 1, True, False
        while match := _TOKEN.match(self.text, self.position):
            if match["close"]:
                break
            self.position = match.end()
            if match["per"] or match["times"]:
                if first or operator:
                    return None
                sign, operator = -1 if match["per"] else sign if self.joined else 1, True
                continue
            part = self._bracket(depth) if match["open"] else self._power(match["unit"], match["power"])
            if part is None:
                return None
            factor *= part[0] ** sign
            dimension = _sum(dimension, part[1], sign)
            first = operator = False
        return None if first or operator or not 1e-30 < factor < 1e30 else (factor, dimension)

    def _bracket(self, depth: int) -> tuple[float, Dimension] | None:
        inner = self._product(depth + 1) if depth < _LARGEST_POWER else None
        match = _TOKEN.match(self.text, self.position)
        if inner is None or match is None or not match["close"]:
            return None
        self.position = match.end()
        power = re.compile(r"(?:\^|\*\*)?([-+]?\d+)").match(self.text, self.position)
        if power is None:
            return inner
        self.position = power.end()
        return _raised(inner, int(power[1]))

    def _power(self, unit: str, power: str | None) -> tuple[float, Dimension] | None:
        known = _GRAM if self.gram and unit == "g" else _known(unit)
        if known is None or power is None:
            return known
        return _raised(known, int(re.sub(r"[\^*()\s]", "", power)))


def _raised(part: tuple[float, Dimension], power: int) -> tuple[float, Dimension] | None:
    if abs(power) > _LARGEST_POWER:
        return None
    length, force, time = part[1]
    return part[0] ** power, (length * power, force * power, time * power)


def _known(unit: str) -> tuple[float, Dimension] | None:
    if unit in _UNITS:
        return _UNITS[unit]
    small = unit.lower()
    spelled = _SPELLINGS.get(small, small)
    return _UNITS.get(spelled) or _SMALL.get(spelled)


_SMALL = {name.lower(): unit for name, unit in reversed(_UNITS.items()) if name not in ("MN", "MHz", "MPa")}
"""By names in small letters, of which the smaller unit counts where two differ in case only."""


def _sum(a: Dimension, b: Dimension, sign: int) -> Dimension:
    return a[0] + sign * b[0], a[1] + sign * b[1], a[2] + sign * b[2]
