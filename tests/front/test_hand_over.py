"""Modes in objects of other programs: faithful stand-ins, and the programs themselves where they are installed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import femtune as ft

HZ = np.array([15.5, 20.4])
SHAPES = np.array([[0.5, 0.7], [0.7, 0.0], [0.5, -0.7]])
DOFS = ["1Z", "2Z", "3Z"]


@dataclass
class Pyoma:
    """A result of an algorithm of pyOMA2."""

    Fn: np.ndarray = field(default_factory=lambda: HZ)
    Phi: np.ndarray = field(default_factory=lambda: SHAPES + 0j)
    Xi: np.ndarray = field(default_factory=lambda: np.array([0.01, 0.02]))
    Fn_std: Any = field(default_factory=lambda: np.array([[0.1], [0.2]]))


@dataclass
class Ema:
    """A model of sdypy.EMA after the identification of its constants."""

    nat_freq: list[float] = field(default_factory=lambda: list(HZ))
    nat_xi: list[float] = field(default_factory=lambda: [0.01, 0.02])
    A: np.ndarray = field(default_factory=lambda: SHAPES + 0j)


@dataclass
class Eigenvectors:
    """A table of eigenvectors of pyNastran: grid point 7 moves along Z, scalar point 9."""

    mode_cycles: list[float] = field(default_factory=lambda: list(HZ))
    node_gridtype: np.ndarray = field(default_factory=lambda: np.array([[7, 1], [9, 2]]))
    data: np.ndarray = field(
        default_factory=lambda: np.array(
            [[[0, 0, 0.5, 0, 0, 0], [0.7, 0, 0, 0, 0, 0]], [[0, 0, -0.7, 0, 0, 0], [0.1] + [0] * 5]]
        )
    )


@pytest.mark.parametrize("given", [Pyoma(), Ema()], ids=["pyOMA2", "sdypy"])
def test_identified_modes_are_taken_from_their_object(given: Any) -> None:
    modes = ft.modal_test(given, dofs=DOFS).modes
    assert modes is not None
    assert modes.freq_hz == pytest.approx(HZ)
    assert np.asarray(modes.shapes) == pytest.approx(SHAPES)
    assert modes.damping_ratio == pytest.approx([0.01, 0.02])
    if isinstance(given, Pyoma):
        assert modes.freq_sd_hz == pytest.approx([0.1, 0.2])


def test_eigenvectors_bring_their_dofs() -> None:
    modes = ft.modal_test(Eigenvectors()).modes
    assert modes is not None
    assert modes.dofs.labels() == ["7Z+", "9S+"]
    assert modes.shapes == pytest.approx(np.array([[0.5, -0.7], [0.7, 0.1]]))


def test_what_is_given_beside_an_object_replaces_what_it_has() -> None:
    modes = ft.modal_test(Pyoma(), dofs=DOFS, freq_sd_hz=0.3).modes
    assert modes is not None
    assert modes.freq_sd_hz == pytest.approx([0.3, 0.3])


@dataclass
class Table:
    """A table of eigenvectors whose arrays do not belong together."""

    mode_cycles: Any
    node_gridtype: Any
    data: Any


@pytest.mark.parametrize(
    "given",
    [
        Table([1.0], None, None),
        Table([1.0], [[1, 1], [2, 1]], np.ones((1, 1, 6))),
        Table([1.0], [[1, 1]], np.ones((1, 1, 3))),
        Table([1.0], [[1, 1]], np.ones((1, 6))),
    ],
    ids=["None", "nodes", "components", "one mode"],
)
def test_eigenvectors_that_do_not_belong_to_their_nodes_are_refused(given: Any) -> None:
    with pytest.raises(ft.FemtuneError) as caught:
        ft.modal_test(given)
    assert caught.value.code == "call.argument"
    assert "'data'" in caught.value.what


@pytest.mark.parametrize(
    "given", [Pyoma(Fn=None), Ema(nat_freq=[]), Pyoma(Phi=SHAPES.T)], ids=["None", "empty", "turned"]
)
def test_an_object_without_modes_is_refused(given: Any) -> None:
    with pytest.raises(ft.FemtuneError) as caught:
        ft.modal_test(given, dofs=DOFS)
    assert caught.value.code == "call.argument"


@pytest.mark.slow
def test_a_result_of_pyoma_itself() -> None:
    result = pytest.importorskip("pyoma2.algorithms.data.result")
    given = result.SSIResult(Fn=HZ, Phi=SHAPES + 0j, Xi=np.array([0.01, 0.02]))
    modes = ft.modal_test(given, dofs=DOFS).modes
    assert modes is not None
    assert modes.damping_ratio == pytest.approx([0.01, 0.02])
    assert modes.freq_sd_hz is None
