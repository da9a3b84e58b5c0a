"""FRFs out: a Universal File with units, nodes, lines and one data set 58 a function, in ASCII.

Values get thirteen significant digits, frequencies ten. Not by pyuff, which turns NaN into zero without a word.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof
from femtune.errors import FemtuneError, Where
from femtune.files.uff.write import data_set, geometry_sets, refuse, units_set
from femtune.files.whole_file import write_whole
from femtune.modal import FrfSet
from femtune.testdata import ModalTest
from femtune.units import UnitSystem

_NUMERATORS = {"receptance": 8, "mobility": 11, "accelerance": 12}
_WORDS = {"receptance": "Displacement", "mobility": "Velocity", "accelerance": "Acceleration"}
_PER_TIME = {"receptance": "", "mobility": "/s", "accelerance": "/s2"}
_FORCE_TYPE, _FREQUENCY_TYPE = 13, 18
_MOST_NODE = 10**10
_EVEN = 1e-9
"""Steps between lines that differ by less, relative to the highest line, count as one."""


def write_uff_frfs(path: str | Path, test: ModalTest, title_lines: Sequence[str] = ()) -> Path:
    """Write the FRFs of a test, or those of a model in the form of one.

    Data sets 164 (units), 2420, 2411, 82 and 2412 (geometry), 58 (a function each; ID line 1 is the name of the
    test). A pair that is NaN throughout is left out.

    Parameters
    ----------
    title_lines : up to four further ID lines

    Raises
    ------
    FemtuneError : ``uff.cannot-write`` for what the format cannot hold: no FRFs, single NaN values, lines that ten
        digits do not tell apart, long names
    """
    _check(test, title_lines)
    lines = [*units_set(test), *geometry_sets(test.geometry)]
    assert test.frfs is not None
    titles = [test.name or "NONE", *(text or "NONE" for text in title_lines)]
    titles += ["NONE"] * (5 - len(titles))
    for i, j in _pairs(test.frfs):
        lines += data_set(58, _function(test.frfs, i, j, test.units, titles))
    try:
        write_whole(Path(path), ("\n".join(lines) + "\n").encode())
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise FemtuneError(
            "uff.cannot-write", f"the file cannot be written: {reason}", where=Where(str(path)),
            hint="name a file in a folder that exists and that you may write to",
        ) from problem  # fmt: skip
    return Path(path)


def _pairs(frfs: FrfSet) -> list[tuple[int, int]]:
    unknown = np.asarray(np.isnan(frfs.values).all(axis=2))
    return [(i, j) for j in range(len(frfs.references)) for i in range(len(frfs.responses)) if not unknown[i, j]]


def _check(test: ModalTest, title_lines: Sequence[str]) -> None:
    frfs = test.frfs
    if frfs is None or not _pairs(frfs):
        raise refuse("there are no FRFs to write")
    for text in (*title_lines, test.name):
        if len(text) > 80 or not text.isprintable():
            raise refuse(f"'{text[:90]!r}' is no ID line", "an ID line is printable and at most 80 long")
    if len(title_lines) > 4:
        raise refuse("a data set 58 has room for four title lines")
    for i, j in _pairs(frfs):
        if np.isnan(frfs.values[i, j]).any():
            raise refuse(f"the FRF from {frfs.references[j]} to {frfs.responses[i]} has missing values (NaN)")
    if max(int(d.node) for d in (*frfs.responses, *frfs.references)) >= _MOST_NODE:
        raise refuse("a node number has more than ten digits")
    texts = [_abscissa(f) for f in frfs.freq_hz]
    if len({float(text) for text in texts}) < len(texts):
        raise refuse("ten digits do not tell two frequency lines apart")


def _function(frfs: FrfSet, i: int, j: int, units: UnitSystem, titles: Sequence[str]) -> Iterator[str]:
    response, reference = frfs.responses[i], frfs.references[j]
    even = _step(frfs.freq_hz)
    yield from titles
    yield f"{4:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10}{_place(response)} {'NONE':<10}{_place(reference)}"
    start, step = (frfs.freq_hz[0], even) if even is not None else (0.0, 0.0)
    yield f"{6:10d}{len(frfs.freq_hz):10d}{even is not None:10d}{_column(start)}{_column(step)}{0.0:13.5E}"
    yield _axis(_FREQUENCY_TYPE, (0, 0), "Frequency", "Hz")
    yield _axis(_NUMERATORS[frfs.kind], *_motion(frfs.kind, response, units))
    yield _axis(_FORCE_TYPE, *_load(reference, units))
    yield _axis(0, (0, 0), "NONE", "NONE")
    yield from _values(frfs.freq_hz, frfs.values[i, j], even is not None)


def _place(dof: Dof) -> str:
    return f"{dof.node:10d}{dof.sign * dof.component:4d}"


def _step(freq_hz: NDArray) -> float | None:
    """The step where start and step, as the file can hold them, give all lines; None else."""
    if len(freq_hz) < 2:
        return None
    start, step = float(_abscissa(freq_hz[0])), float(_abscissa((freq_hz[-1] - freq_hz[0]) / (len(freq_hz) - 1)))
    made = start + step * np.arange(len(freq_hz))
    return step if step > 0.0 and np.abs(made - freq_hz).max() <= _EVEN * freq_hz[-1] else None


def _axis(kind: int, exponents: tuple[int, int], word: str, unit: str) -> str:
    length, force = exponents
    return f"{kind:10d}{length:5d}{force:5d}{0:5d} {word:<20} {unit:<20}"


def _motion(kind: str, dof: Dof, units: UnitSystem) -> tuple[tuple[int, int], str, str]:
    turns = dof.component > 3
    unit = "rad" if turns else units.name.split("-", maxsplit=1)[0]
    return (0 if turns else 1, 0), _WORDS[kind], unit + _PER_TIME[kind]


def _load(dof: Dof, units: UnitSystem) -> tuple[tuple[int, int], str, str]:
    force = force_unit(units)
    if dof.component > 3:
        length = units.name.split("-", maxsplit=1)[0]
        return (1, 1), "Excitation Force", f"{force}.{length}"
    return (0, 1), "Excitation Force", force


def force_unit(units: UnitSystem) -> str:
    """Name of the unit of force: N, kN, mN or lbf where it is one of these, else mass.length/s2."""
    for name, size in (("N", 1.0), ("mN", 1e-3), ("kN", 1e3), ("lbf", 4.4482216152605)):
        if abs(units.force / size - 1.0) < 1e-12:
            return name
    length, mass, _ = units.name.split("-")
    return f"{mass}.{length}/s2"


def _abscissa(x: float) -> str:
    """As many digits as twelve columns hold; a point is always there, as Fortran's formats want it."""
    for digits in range(10, 4, -1):
        text = f"{float(x):.{digits}g}"
        if "e" in text:
            mantissa, exponent = text.split("e")
            text = f"{mantissa}{'' if '.' in mantissa else '.'}E{exponent}"
        elif "." not in text:
            text += "."
        if len(text) <= 12:
            return text
    return f"{float(x):.5E}"


def _column(x: float) -> str:
    return f"{_abscissa(x):>13}"


def _values(freq_hz: NDArray, values: NDArray, even: bool) -> Iterator[str]:
    pairs = [f"{v.real:20.12E}{v.imag:20.12E}" for v in values]
    if even:
        yield from ("".join(pairs[k : k + 2]) for k in range(0, len(pairs), 2))
    else:
        yield from (f"{_column(f)}{pair}" for f, pair in zip(freq_hz, pairs))
