"""Multiquadrics: φ = −√(1 + h²), with the inputs scaled to the unit cube (Hardy 1971)."""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals
from femtune.surrogates.correlations import CorrelationFunction
from femtune.surrogates.radial import RadialFunction


def _value(squared: Reals) -> Reals:
    return np.asarray(-np.sqrt(1.0 + squared))


def _slope(squared: Reals) -> Reals:
    return np.asarray(-0.5 / np.sqrt(1.0 + squared))


def _curvature(squared: Reals) -> Reals:
    return np.asarray(0.25 / (1.0 + squared) ** 1.5)


MULTIQUADRIC = RadialFunction(CorrelationFunction("multiquadric", _value, _slope, _curvature), "constant")
