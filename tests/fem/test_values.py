"""The table of values: entries that follow from entries that follow from others."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.fem.fields import FieldRef
from femtune.fem.values import ValueTableBuilder
from femtune.parameters import jet
from femtune.parameters.jet import Jet


def _twice(x: Jet) -> Jet:
    return 2.0 * x


def _square(x: Jet) -> Jet:
    return x * x


def test_a_rule_may_stand_before_and_after_another_one():
    """Twice, squared, and twice again: 2 (2x)² = 8x², with the derivatives 16x and 16."""
    table = ValueTableBuilder()
    x = table.add(FieldRef("MAT1", 1, "E"), 3.0)
    double = table.derive(FieldRef("MAT1", 1, "double"), _twice, x)
    square = table.derive(FieldRef("MAT1", 1, "square"), _square, double)
    last = table.derive(FieldRef("MAT1", 1, "last"), _twice, square)
    values = table.table()
    assert values.values[last] == 72.0
    moved = values.evaluate({x: jet.variables(np.array([5.0]))[0]}, 1)[last]
    assert float(moved.value) == pytest.approx(200.0)
    np.testing.assert_allclose(moved.grad, [80.0])
    np.testing.assert_allclose(moved.hess, [[16.0]])
