"""A check of the derivatives of a model of a user's own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from femtune.study.own_model import OwnModel

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.study.described import Model

_STEP = 1e-5
"""Step of the central differences, relative to each value: truncation and rounding are both about 1e-10."""


def check_own_model(model: Model, values: Mapping[str, float], tolerance: float = 1e-5) -> None:
    """The derivatives of a model of a user's own, frequencies and shapes, against central differences.

    Shapes of both sides are turned to the sign of those at the point; a shape must therefore be scaled alike at both.

    Parameters
    ----------
    model : of `femtune.own_model`
    values : of the parameters, by name; not zero
    tolerance : largest error, relative to the largest derivative of frequencies or of shapes

    Raises
    ------
    AssertionError : the derivatives are not those of the modes, or the model has none
    FemtuneError : ``external.own-model`` for what does not have the form of modes
    """
    own = next(iter(model.own_model.values()), None)
    assert isinstance(own, OwnModel), "check_own_model checks a model of femtune.own_model"
    assert own.derivatives is not None, f"{own.name} has no method derivatives"
    point = {name: float(value) for name, value in values.items()}
    centre = own.modes(point)
    exact = own.slopes(point, centre, tuple(point))
    for name, value in point.items():
        assert value != 0.0, f"the value of {name} is zero; choose another point"
        step = _STEP * abs(value)
        after, before = (own.modes({**point, name: value + s}) for s in (step, -step))
        pairs = [("frequencies", after.freq_hz, before.freq_hz, exact[name].freq_hz)]
        if centre.has_shapes:
            higher, lower = _turned(after.shapes, centre.shapes), _turned(before.shapes, centre.shapes)
            pairs.append(("shapes", higher, lower, exact[name].shapes))
        for what, one, other, given in pairs:
            _compare(f"derivatives of {what} by {name}", (one - other) / (2.0 * step), given, tolerance)


def _turned(shapes: Reals, like: Reals) -> Reals:
    sides = np.nansum(shapes * like, axis=(0, 1))
    return shapes * np.where(sides < 0.0, -1.0, 1.0)


def _compare(what: str, by_step: Reals, given: Reals, tolerance: float) -> None:
    size = max(float(np.nanmax(np.abs(by_step))), float(np.nanmax(np.abs(given))))
    error = np.abs(given - by_step)
    mode = int(np.nanargmax(np.nanmax(error.reshape(-1, error.shape[-1]), axis=0)))
    worst = float(np.nanmax(error))
    assert worst <= tolerance * size, f"{what}: mode {mode + 1} is off by {worst / size:.2g} of the largest one"
