"""Measured damping for the paired modes of a calibrated model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.correlation import pair_modes, paired_damping
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.model import damping_by_mode, solve_modes
from femtune.model.response import frf, make_ports
from structures.springs import factor_model, spring_structure

from ..messages.shown import check_shown

UNEVEN = np.array([0.004, 0.03, 0.012, 0.02, 0.001, 0.01])
SEEN = ["1X+", "3X+", "4X+", "6X+"]


def _modes() -> tuple[ModeSet, ModeSet]:
    """The modes of a chain as a test sees them, in another order and without the third, and those of the chain."""
    springs = [(i - 1, i, 100.0 + 10.0 * i) for i in range(6)]
    chain = factor_model(spring_structure(springs, [1.0, 1.2, 0.9, 1.0, 1.1, 1.0]), {"a": [1]})
    solved, ports = solve_modes(chain.at(np.zeros(1)), 6), make_ports(chain, ["1X+"], SEEN)
    shapes = np.asarray(ports.outputs @ solved.shapes)
    model = ModeSet(solved.freq_hz, shapes, DofSet(ports.output_labels))
    order = [1, 0, 4, 3, 5]
    test = ModeSet(
        solved.freq_hz[order] * 1.01, -shapes[:, order], DofSet(ports.output_labels), damping_ratio=UNEVEN[order]
    )
    return test, model


def test_every_mode_gets_the_damping_of_its_partner() -> None:
    test, model = _modes()
    found = paired_damping(test, pair_modes(test, model), 6)
    paired = [0, 1, 3, 4, 5]
    np.testing.assert_array_equal(found[paired], UNEVEN[paired])
    assert found[2] == np.median(UNEVEN[paired])
    assert paired_damping(test, pair_modes(test, model), 6, 0.012)[2] == 0.012


def test_functions_with_mapped_damping_are_those_of_the_test() -> None:
    springs = [(i - 1, i, 100.0 + 10.0 * i) for i in range(6)]
    chain = factor_model(spring_structure(springs, [1.0, 1.2, 0.9, 1.0, 1.1, 1.0]), {"a": [1]})
    solved, ports = solve_modes(chain.at(np.zeros(1)), 6), make_ports(chain, ["1X+"], SEEN)
    lines = np.linspace(0.3, 4.0, 90)
    test, model = _modes()
    ratios = paired_damping(test, pair_modes(test, model), 6, 0.012)
    want, found = (frf(solved, ports, lines, damping=damping_by_mode(r)).values for r in (tuple(UNEVEN), ratios))
    np.testing.assert_allclose(found, want, rtol=1e-12)


def test_a_test_without_damping() -> None:
    test, model = _modes()
    bare = replace(test, damping_ratio=None, source="hammer test")
    with pytest.raises(FemtuneError) as caught:
        paired_damping(bare, pair_modes(bare, model), 6)
    check_shown("correlate.no-damping", caught.value)
