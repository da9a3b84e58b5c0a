"""A test whose frequencies and shapes are given as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.study.given_dofs import given_dofs
from femtune.study.handed_over import handed_over
from femtune.testdata import NO_GEOMETRY, ModalTest, WireFrame, sensors_at
from femtune.units import UnitSystem

_FUNCTION = "modal_test"
_FREQUENCIES = "one positive frequency in Hz for each mode"
_SHAPES = "one row for each degree of freedom and one column for each mode"


def modal_test_of_arrays(
    freq_hz: Any,
    shapes: Any,
    dofs: Any,
    *,
    freq_sd_hz: Any,
    damping_ratio: Any,
    points: Any,
    units: UnitSystem,
    name: str,
) -> ModalTest:
    """The test; arguments and errors as of `femtune.modal_test`."""
    known = handed_over(freq_hz)
    if known is not None:
        freq_hz = known["freq_hz"]
        shapes = known["shapes"] if shapes is None else shapes
        dofs = known.get("dofs") if dofs is None else dofs
        damping_ratio = known.get("damping_ratio") if damping_ratio is None else damping_ratio
        freq_sd_hz = known.get("freq_sd_hz") if freq_sd_hz is None else freq_sd_hz
    hz = array_of(freq_hz, "freq_hz", _FREQUENCIES).astype(float)
    if hz.ndim != 1 or not hz.size:
        raise _shape("freq_hz", hz, "(m,)", _FREQUENCIES)
    _check(hz, "freq_hz", _FREQUENCIES, np.isfinite(hz) & (hz > 0.0))
    phi, rows = _shapes(shapes, dofs, len(hz))
    modes = ModeSet(
        hz,
        phi,
        rows,
        freq_sd_hz=_of_modes(freq_sd_hz, "freq_sd_hz", "positive standard deviations in Hz", len(hz), 0.0, np.inf),
        damping_ratio=_of_modes(
            damping_ratio, "damping_ratio", "fractions of critical damping, 0.02 for 2 %", len(hz), 0.0, 1.0
        ),
        source="arrays",
    )
    frame = NO_GEOMETRY if points is None else _frame(points, rows)
    return ModalTest(name or "arrays", units, frame, sensors_at(frame, rows), modes)


def _shapes(shapes: Any, dofs: Any, count: int) -> tuple[np.ndarray, DofSet]:
    """Shapes (n, m) and the DOFs of their rows; none where there are frequencies only."""
    if shapes is None:
        if dofs is not None:
            raise FemtuneError(
                "call.argument/array", values={"shapes": None}, name="shapes", function=_FUNCTION,
                kind="real or complex", meaning=_SHAPES,
            )  # fmt: skip
        return np.zeros((0, count)), DofSet(())
    phi = array_of(shapes, "shapes", _SHAPES, complex_too=True)
    rows = None if dofs is None else given_dofs(dofs, _FUNCTION)
    expected = ("n" if rows is None else len(rows), count)
    if phi.ndim != 2 or phi.shape[1] != count or not phi.size or (rows is not None and len(phi) != len(rows)):
        turned = phi.ndim == 2 and phi.shape[0] == count and expected[0] in ("n", phi.shape[1])
        code = "call.argument/array-transposed" if turned else "call.argument/array-shape"
        raise _shape("shapes", phi, f"({expected[0]}, {expected[1]})", _SHAPES, code)
    _check(phi, "shapes", "finite numbers; NaN marks an entry that was not measured", ~np.isinf(phi))
    return phi, DofSet(Dof(i, "S") for i in range(1, len(phi) + 1)) if rows is None else rows


def array_of(given: Any, name: str, meaning: str, *, complex_too: bool = False, function: str = _FUNCTION) -> Any:
    """What is given as an array of numbers (error ``call.argument``)."""
    try:
        array = np.asarray(given)
    except (TypeError, ValueError):
        array = np.empty(0, object)
    if array.dtype.kind not in ("iufc" if complex_too else "iuf") or isinstance(given, str | bytes | Mapping):
        found = f"{type(given).__name__} of {array.dtype}" if isinstance(given, np.ndarray) else type(given).__name__
        kind = "real or complex" if complex_too else "real"
        raise FemtuneError(
            "call.argument/array", values={name: found}, name=name, function=function, kind=kind, meaning=meaning
        )
    if isinstance(given, np.ma.MaskedArray):
        # a masked entry is not known: without its mask it would be a number
        return np.where(np.ma.getmaskarray(given), np.nan, array)
    return array


def _of_modes(given: Any, name: str, wanted: str, count: int, low: float, high: float) -> Reals | None:
    """(m,) values that may be given as one number for all modes; NaN where a value is not known."""
    if given is None:
        return None
    meaning = f"one value for each mode: {wanted}"
    array = array_of(given, name, meaning).astype(float)
    if array.shape not in ((), (count,)):
        raise _shape(name, array, f"({count},)", meaning)
    _check(
        array,
        name,
        meaning,
        np.isnan(array) | ((array > low if name == "freq_sd_hz" else array >= low) & (array < high)),
    )
    return np.broadcast_to(array, (count,)).copy()


def _frame(points: Any, dofs: DofSet) -> WireFrame:
    """The points of a test from their coordinates by node number."""
    try:
        known = {_number(node): np.asarray(place, float) for node, place in dict(points).items()}
    except (TypeError, ValueError):
        raise FemtuneError("call.argument/points", function=_FUNCTION) from None
    missing = sorted({dof.node for dof in dofs} - set(known))
    bad = sorted(node for node, place in known.items() if place.shape != (3,) or not np.isfinite(place).all())
    if missing or bad or not known:
        values = {"nodes without coordinates": str(missing[:8])} if missing else {"nodes": str(bad[:8])}
        raise FemtuneError("call.argument/points", values=values, function=_FUNCTION)
    return WireFrame(np.array(list(known)), np.array(list(known.values())))


def _number(node: Any) -> int:
    """The number of a node (ValueError for a fraction, which would be that of another node)."""
    if int(node) != float(node):
        raise ValueError(node)
    return int(node)


def _shape(
    name: str, array: np.ndarray, expected: str, meaning: str, code: str = "call.argument/array-shape"
) -> FemtuneError:
    return FemtuneError(code, name=name, function=_FUNCTION, given=str(array.shape), expected=expected, meaning=meaning)


def _check(array: np.ndarray, name: str, meaning: str, good: np.ndarray) -> None:
    """Refuse values that cannot be used, with the first of them."""
    if np.all(good):
        return
    at = np.argwhere(~np.atleast_1d(good))[0]
    place = ", ".join(str(i + 1) for i in at)
    values = {"first entry": f"number {place}", "value": str(np.atleast_1d(array)[tuple(at)])}
    raise FemtuneError("call.argument/array-values", values=values, name=name, function=_FUNCTION, meaning=meaning)
