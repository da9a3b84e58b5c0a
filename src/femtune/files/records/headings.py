"""What the headings of columns say: DOF, quantity and unit of a channel; and the lines above them: the rate."""

from __future__ import annotations

import re
from collections.abc import Sequence

from femtune.dofs import Dof
from femtune.files.records.table import LONGEST_HEADING, StatedChannel
from femtune.unit_labels import PRESSURE, UnitLabel, frequency_factor, time_factor, unit_label

_BRACKETS = re.compile(r"[\[({]([^\[\](){}]*(?:\([^()]*\)[^\[\](){}]*)*)[\])}]")
_DOF = re.compile(r"(?<![\d.])(\d{1,9})\s*:?\s*([+-]?)(R?[XYZ])([+-]?)(?![\w.])", re.IGNORECASE)
_FORCE = re.compile(r"(?<![a-z])(force|hammer|kraft|excitation|load ?cell|fuerza|forza|effort)(?![a-z])", re.IGNORECASE)
_HAMMER = re.compile(r"(?<![a-z])(impact|impulse|marteau|martillo|martello)(?![a-z])", re.IGNORECASE)
_MOTIONS = {
    "acceleration": re.compile(r"(?<![a-z])(acc|accel|accelerometer|acceleration|beschleunigung)(?![a-z])", re.I),
    "velocity": re.compile(r"(?<![a-z])(vel|velocity|geschwindigkeit)(?![a-z])", re.IGNORECASE),
    "displacement": re.compile(r"(?<![a-z])(disp|displacement|verschiebung)(?![a-z])", re.IGNORECASE),
}


def stated_channel(heading: str, unit: str = "") -> StatedChannel:
    """DOF, quantity and unit of a column by its heading, such as ``Acc 12Z+ [m/s^2]``, and by a unit stated elsewhere.

    Examples
    --------
    >>> from femtune.files.records.headings import stated_channel
    >>> stated_channel("Acc 12Z- [g]")
    StatedChannel(dof=Dof(node=12, direction='Z', sign=-1), quantity='acceleration', unit='g')
    >>> stated_channel("hammer").quantity
    'force'
    """
    heading = heading[:LONGEST_HEADING]
    label = unit or _unit_in(heading)
    plain = _BRACKETS.sub(" ", heading).replace("_", " ")
    return StatedChannel(_dof_in(plain), _quantity(plain, unit_label(label)), label)


def _unit_in(heading: str) -> str:
    """The last text in brackets that is a unit, or what stands behind a solidus between blanks."""
    texts = [*_BRACKETS.findall(heading), *heading.split(" / ")[1:]]
    return next((text.strip() for text in reversed(texts) if unit_label(text) is not None), "")


def _dof_in(text: str) -> Dof | None:
    matches = _DOF.findall(text)
    if len(matches) != 1:
        return None
    node, before, direction, behind = matches[0]
    return Dof(int(node), direction.upper(), -1 if "-" in (before, behind) else 1) if int(node) else None


def _quantity(text: str, label: UnitLabel | None) -> str:
    """By the unit, or else by a word; strain and pressure are no motion and no force."""
    if label is not None and (label.is_force or label.motion):
        return "force" if label.is_force else str(label.motion)
    if label is not None and any(label.dimension):
        return "pressure" if label.dimension == PRESSURE else "unknown"
    if _FORCE.search(text):
        return "force"
    motion = next((quantity for quantity, word in _MOTIONS.items() if word.search(text)), "unknown")
    # "impact acceleration" is a response
    return "force" if motion == "unknown" and _HAMMER.search(text) else motion


# ----------------------------------------------------------------------------------------------------
# The sampling rate in the lines before the numbers.

_VALUE = (
    r"(?![a-z])[ _]*(?:[\[(](?P<bracket>[^\])]*)[\])])?[\s:=,;\"]+(?P<number>[\d.,]*\d(?:e[+-]?\d+)?)"
    r"\s*(?P<unit>(?:k?hz|[mµun]?s(?!\w))?)"
)
_RATE = re.compile(
    r"(?<![a-z])(?:(?:sampl\w*|data|scan|acquisition|abtast|mess)[ _-]*(?:rate|freq\w*)|fs|^\W*rate)" + _VALUE,
    re.IGNORECASE,
)
_STEP = re.compile(
    r"(?<![a-z])(?:(?:sampl\w*|time|x)[ _-]*(?:interval|period|step|increment)|delta[ _]?[tx]|dt)" + _VALUE,
    re.IGNORECASE,
)
_LONGEST_LINE = 500
"""Letters of a line that are read."""


def stated_rate(lines: Sequence[str]) -> float | None:
    """The sampling rate in Hz that lines of words state, by itself or as a time step; None if they state several.

    Examples
    --------
    >>> from femtune.files.records.headings import stated_rate
    >>> stated_rate(["Sample rate (kHz): 51.2", "filter = 488 Hz"]), round(stated_rate(["Sample Interval,4e-6,s"]))
    (51200.0, 250000)
    """
    rates = {round(hz, 9) for line in lines for hz in _rates(line[:_LONGEST_LINE])}
    return rates.pop() if len(rates) == 1 else None


def _rates(line: str) -> list[float]:
    """Positive sampling rates in a line."""
    out = []
    for form, unit_of in ((_RATE, frequency_factor), (_STEP, time_factor)):
        for match in form.finditer(line):
            unit = match["unit"] or match["bracket"] or ""
            number, factor = _plain_number(match["number"]), unit_of(unit) if unit else 1.0
            if number and factor:
                out.append(number * factor if form is _RATE else 1.0 / (number * factor))
    return out


def _plain_number(text: str) -> float | None:
    """A number with a decimal point or comma; None for another text, and for one beyond all rates."""
    plain = text.rstrip(",")
    try:
        number = float(plain if "." in plain else plain.replace(",", "."))
    except ValueError:
        return None
    return number if _LEAST_RATE < number < 1.0 / _LEAST_RATE else None


_LEAST_RATE = 1e-12
"""Least number that is a rate or a time step."""
