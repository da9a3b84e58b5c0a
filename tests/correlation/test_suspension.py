"""Modes of the suspension: a free chain of masses on soft springs, whose modes are known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.correlation.free_beam import EVERYWHERE, beam

from femtune.correlation import Correlation, correlate
from femtune.modal import ModeSet
from femtune.validation import assess


def compared(test: ModeSet, model: ModeSet, rigid: int = 2) -> Correlation:
    return correlate(test, model, rigid=rigid)


def suspension(found: Correlation) -> list[int]:
    return [u.test for u in found.pairing.unpaired_test if u.suspension]


def test_modes_of_the_suspension_are_set_apart() -> None:
    rng = np.random.default_rng(3)
    test = beam(EVERYWHERE, soft_hz=4.0)
    test = replace(test, shapes=test.shapes + 0.05 * rng.standard_normal(test.shapes.shape))
    found = compared(test, beam(EVERYWHERE))
    assert suspension(found) == [0, 1]
    assert [p.test for p in found.pairing.pairs] == [2, 3, 4, 5, 6]
    (notice,) = [n for n in found.notices if n.code == "correlate.suspension"]
    assert notice.level == "info"
    assert "1 (4 Hz), 2 (4 Hz)" in notice.what
    # they decide no criterion
    assert not [v for v in assess(found) if "without a partner" in v.remark]


def test_a_model_on_soft_springs_has_these_modes_too() -> None:
    found = compared(beam(EVERYWHERE, soft_hz=4.1), beam(EVERYWHERE, soft_hz=4.0), rigid=0)
    assert len(found.pairing.pairs) == 7
    assert not found.notices


@pytest.mark.parametrize("stiffer", [0.5, 1.6])
def test_elastic_modes_are_none(stiffer: float) -> None:
    """Also those whose frequencies differ so much that they find no partner."""
    test = beam(EVERYWHERE, stiffer=stiffer).select_modes([2, 3, 4])
    found = compared(test, beam(EVERYWHERE))
    assert not suspension(found)
    assert len(found.pairing.unpaired_test) >= 1


@pytest.mark.parametrize(
    ("sensors", "reason"), [(np.array([0.0, 0.5, 1.0]), "too few"), (np.linspace(0.0, 0.2, 9), "elastic mode")]
)
def test_sensors_that_cannot_tell_say_so(sensors: np.ndarray, reason: str) -> None:
    """Three sensors, and nine near one end, where a bending mode moves nearly as a rigid body."""
    found = compared(beam(sensors, soft_hz=4.0), beam(sensors))
    assert not suspension(found)
    (notice,) = [n for n in found.notices if n.code == "correlate.suspension"]
    assert "cannot tell" in notice.what
    assert reason in notice.what


def test_modes_left_out_by_hand_keep_their_reason() -> None:
    found = correlate(beam(EVERYWHERE, soft_hz=4.0), beam(EVERYWHERE), rigid=2, left_out={0: "bungee"})
    assert suspension(found) == [1]
    assert [u.reason for u in found.pairing.unpaired_test if u.left_out] == ["bungee"]
