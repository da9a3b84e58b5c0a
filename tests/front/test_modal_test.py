"""`ft.modal_test`: a test from arrays, and matrices with such a test up to the parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg as la
from tests.messages.shown import check_shown

import femtune as ft
from femtune.testing import example_deck

CHAIN = 2e4 * np.eye(3) - 1e4 * (np.eye(3, k=1) + np.eye(3, k=-1))
MASS = 2.0 * np.eye(3)
NAMES = ["1Z", "2Z", "3Z"]
TRUE = 1.3


def model() -> ft.Model:
    parts = [{"name": "CHAIN", "file": CHAIN}, {"name": "GROUND", "file": 1e4 * np.eye(3)}]
    return ft.read_matrices(parts, MASS, dofs=NAMES, units="m-kg-s")


def truth() -> tuple[np.ndarray, np.ndarray]:
    values, shapes = la.eigh(CHAIN + TRUE * 1e4 * np.eye(3), MASS)
    return np.sqrt(values) / (2.0 * np.pi), shapes


@pytest.mark.parametrize("with_shapes", [True, False], ids=["shapes", "frequencies"])
@pytest.mark.parametrize(
    "dofs", [NAMES, np.array(NAMES), np.array([[1, 3], [2, 3], [3, 3]])], ids=["texts", "str", "int"]
)
def test_the_factor_of_a_matrix_is_found_with_its_standard_deviation(
    with_shapes: bool, dofs: Any, tmp_path: Path
) -> None:
    hz, shapes = truth()
    test = ft.modal_test(hz, shapes if with_shapes else None, dofs=dofs if with_shapes else None, freq_sd_hz=0.01 * hz)
    found = ft.update(
        model(),
        test,
        parameters=[ft.Parameter("ground", fields=["MATRIX GROUND"], lower=0.5, upper=2.0)],
        residuals=[ft.FrequencyResidual(sd="test")],
        output=tmp_path,
    )
    # σ² = 1 / Σ (∂ ln f/∂p)²/0.01² with ∂ ln f/∂p = φᵀK_gφ/(2λ), φᵀMφ = 1
    slopes = 1e4 / 2.0 / (2.0 * (2.0 * np.pi * hz) ** 2)
    row = found.parameters[0]
    assert row.value == pytest.approx(TRUE, rel=1e-6)
    assert row.sd == pytest.approx(0.01 / np.linalg.norm(slopes), rel=1e-3)


def test_points_place_the_sensors_of_a_deck(tmp_path: Path) -> None:
    deck = ft.read_deck(example_deck(tmp_path), units="m-kg-s")
    nodes = deck.structure.nodes
    points = dict(zip(nodes.ids.tolist(), nodes.xyz + 1e-6))
    known = ft.modes(deck, count=2)
    modes = known.mode_sets["baseline"]
    rows = [i for i, dof in enumerate(modes.dofs) if dof.component in (2, 3)]
    test = ft.modal_test(modes.freq_hz, modes.shapes[rows], dofs=modes.dofs.select(rows), points=points)
    pairs = ft.correlate(deck, test, modes={"count": 2}).pairs
    assert [row.mac for row in pairs] == pytest.approx([1.0, 1.0])


WRONG: dict[str, tuple[tuple[Any, ...], dict[str, Any], tuple[str, ...]]] = {
    "text": (("12 Hz",), {}, ("'freq_hz'", "str")),
    "nothing": (([],), {}, ("'freq_hz'", "(0,)", "(m,)")),
    "NaN": (([1.0, np.nan],), {}, ("'freq_hz'", "number 2", "nan")),
    "negative": (([-1.0],), {}, ("'freq_hz'", "-1.0")),
    "complex frequencies": (([1.0 + 1j],), {}, ("'freq_hz'", "real")),
    "transposed": (([1.0, 2.0], np.ones((2, 3))), {"dofs": NAMES}, ("'shapes'", "(2, 3)", "(3, 2)", "shapes.T")),
    "rows": (([1.0, 2.0], np.ones((4, 2))), {"dofs": NAMES}, ("'shapes'", "(4, 2)", "(3, 2)")),
    "one dimension": (([1.0], np.ones(3)), {"dofs": NAMES}, ("'shapes'", "(3,)", "(3, 1)")),
    "ragged": (([1.0, 2.0], [[1, 2], [1]]), {}, ("'shapes'",)),
    "infinite": (([1.0], [[np.inf]]), {}, ("'shapes'", "inf")),
    "rows without shapes": (([1.0],), {"dofs": NAMES}, ("'shapes'", "None")),
    "deviations": (([1.0, 2.0],), {"freq_sd_hz": [0.1] * 3}, ("'freq_sd_hz'", "(3,)", "(2,)")),
    "deviation zero": (([1.0],), {"freq_sd_hz": 0.0}, ("'freq_sd_hz'", "0.0")),
    "damping in percent": (([1.0],), {"damping_ratio": 2.0}, ("'damping_ratio'", "0.02 for 2 %")),
    "points of other nodes": (
        ([1.0], np.ones((3, 1))),
        {"dofs": NAMES, "points": {1: (0, 0, 0)}},
        ("points", "[2, 3]"),
    ),
    "points in a plane": (([1.0], [[1.0]]), {"dofs": ["1Z"], "points": {1: (0, 0)}}, ("points", "[1]")),
    "points as an array": (([1.0], [[1.0]]), {"dofs": ["1Z"], "points": np.ones((1, 3))}, ("points",)),
    "a masked frequency": ((np.ma.array([1.0, 2.0], mask=[False, True]),), {}, ("'freq_hz'", "number 2", "nan")),
    "points of a fraction": (
        ([1.0], [[1.0]]),
        {"dofs": ["1Z"], "points": {1.5: (0, 0, 0), 1: (1, 0, 0)}},
        ("points",),
    ),
    "one text for dofs": (([1.0], [[1.0]]), {"dofs": "1Z"}, ("'dofs'", "str")),
    "numbers for dofs": (([1.0], [[1.0]]), {"dofs": np.array([1])}, ("'dofs'", "entry = 1")),
}


@pytest.mark.parametrize("name", WRONG)
def test_an_argument_that_does_not_fit_is_named_with_what_it_needs(name: str) -> None:
    args, words, told = WRONG[name]
    with pytest.raises(ft.FemtuneError) as caught:
        ft.modal_test(*args, **words)
    assert caught.value.code == "call.argument"
    assert [text for text in told if text not in str(caught.value)] == []
    check_shown(f"call.argument, modal_test, {name}", caught.value)


def test_a_masked_entry_of_a_shape_was_not_measured() -> None:
    shape = np.ma.array([[1.0], [7.0]], mask=[[False], [True]])
    modes = ft.modal_test([1.0], shape, dofs=["1Z", "2Z"]).modes
    assert modes is not None
    assert np.isnan(modes.shapes[1, 0])
    assert modes.shapes[0, 0] == 1.0


POSITIONAL: dict[str, Any] = {
    "parameter": (lambda: ft.Parameter("E", "MAT1 1 E"), ("fields='MAT1 1 E'",)),  # type: ignore[misc]
    "residual": (lambda: ft.FrequencyResidual(0.01), ("FrequencyResidual(sd=0.01)",)),  # type: ignore[misc]
    "units": (lambda: ft.read_deck("frame.bdf", "m-kg-s"), ("units=…", "only path")),  # type: ignore[misc]
    "parameters": (lambda: ft.update("a.bdf", "a.uff", []), ("source and test", "parameters=…")),  # type: ignore[misc]
    "configuration": (lambda: ft.Configuration("A", "a.uff"), ("test='a.uff'",)),  # type: ignore[misc]
}


@pytest.mark.parametrize("name", POSITIONAL)
def test_values_without_names_are_answered_with_what_to_write(name: str) -> None:
    call, told = POSITIONAL[name]
    with pytest.raises(ft.FemtuneError) as caught:
        call()
    assert caught.value.code == "call.signature"
    assert [text for text in told if text not in str(caught.value)] == []
    check_shown(f"call.signature, {name} by position", caught.value)


def test_objects_of_other_classes_are_no_dofs() -> None:
    for call in (lambda: ft.DofSet(["1Z"]), lambda: ft.ModeSet(np.ones(1), np.ones((1, 1)), ["1Z"])):  # type: ignore[list-item,arg-type]
        with pytest.raises(ft.FemtuneError, match="dofs") as caught:
            call()
        assert caught.value.code == "call.argument"
