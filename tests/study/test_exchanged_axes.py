"""Axes of a test that are exchanged although all sensors have grid points: the key that repairs it is proposed."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.testdata import ModalTest

from .cantilever import EI, Bench

BY_ID = "[sensors]\nby_id = true\n"


def exchanged(test: ModalTest, matrix: np.ndarray) -> ModalTest:
    """The test as somebody records it whose axes are turned: coordinates are unknown, directions wrong."""
    frame = test.geometry
    turned = replace(frame, axes=frame.axes @ matrix, coordinates=np.zeros_like(frame.coordinates))
    return replace(test, geometry=turned, sensors=())


def proposed(words: str) -> dict[str, object]:
    key, _, table = words.rpartition("write ")[2].rpartition(" in ")
    return tomllib.loads(f"{table}\n{key}")["test"]


@pytest.mark.quick(0)
@pytest.mark.parametrize("turn", [((0, 1, 0), (0, 0, 1), (1, 0, 0)), ((0, -1, 0), (1, 0, 0), (0, 0, 1))])
def test_the_rotation_that_fits_is_proposed(bench: Bench, turn: tuple) -> None:
    bench.uff(exchanged(bench.measure(bench.truth()), np.array(turn, float)))
    (alert,) = [a for c in ft.correlate(bench.study(BY_ID)).records for a in c.alerts if a.code == "correlate.axes"]
    if turn[2] == (0, 0, 1):
        check_shown("correlate.axes", f"[correlate.axes] {alert.sentence}")
    rotation = f"rotation = {proposed(alert.sentence)['rotation']}\n"
    found = ft.correlate(bench.study(rotation + BY_ID)).records[0]
    assert not [a for a in found.alerts if a.code == "correlate.axes"]
    assert len(found.pairs) == 4
    assert min(pair.mac for pair in found.pairs) > 0.99


@pytest.mark.slow
def test_an_update_without_pairs_states_the_rotation(bench: Bench) -> None:
    """Directions across the beam are exchanged; turns by 90° to either side fit."""
    bench.uff(exchanged(bench.measure(bench.truth()), np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)))
    with pytest.raises(FemtuneError) as error:
        ft.update(bench.study(f"{BY_ID}[correlate]\nfrequency_gate = 0.2\n{EI}"))
    assert error.value.code == "correlate.no-pairs"
    assert "rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]" in str(error.value.hint)
