"""Misfits along parameters: smooth ones of structures, and others with modes that cross lines, kinks and jumps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.arrays import Complexes, Reals
from femtune.dofs import DofSet
from femtune.files.uff import write_uff_frfs
from femtune.modal import FrfSet
from femtune.selection import Smoothness, line_smoothness
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI
from structures.plan_chain import chain_frfs
from structures.plan_frame import DenseFrame


def _along(functions: Callable[[Reals], Complexes], start: Reals, truth: Reals, i: int) -> Smoothness:
    """Of the logarithms of the ratio of dense FRFs, slopes by central differences."""
    test: Complexes = functions(truth)

    def residuals(x: Reals) -> Reals:
        off = np.log(functions(x) / test).ravel() / 0.05
        return np.concatenate([off.real, off.imag])

    scale = 0.5 * float(residuals(start) @ residuals(start))

    def misfit(value: float) -> tuple[float, float]:
        x, e = start.copy(), np.zeros(len(start))
        x[i], e[i] = value, 1e-6
        r = residuals(x)
        return 0.5 * float(r @ r) / scale, float(r @ (residuals(x + e) - residuals(x - e))) / 2e-6 / scale

    return line_smoothness("x", misfit, 0.7, 1.3)


def _chain(ratio: float, lines: Reals | None = None) -> Callable[[Reals], Complexes]:
    hz = np.geomspace(4.0, 45.0, int(np.ceil(3.0 * np.log(45.0 / 4.0) / (2.0 * ratio))) + 1) if lines is None else lines
    return lambda x: chain_frfs(x, hz, ratio)[np.ix_([1, 5, 9, 13], [8])]


def _frame(ratio: float) -> Callable[[Reals], Complexes]:
    frame, hz = DenseFrame.made(), np.geomspace(20.0, 420.0, int(np.ceil(3.0 * np.log(21.0) / (2.0 * ratio))) + 1)
    return lambda x: frame.frfs(x, np.array([90, 76, 61, 28]), np.array([49]), hz, ratio)


_FRAME_START, _FRAME_TRUTH = np.array([1.04, 0.97, 1.0, 1.03]), np.array([1.12, 0.9, 1.08, 0.85])
_CHAIN_TRUTH = np.array([1.1, 0.93, 1.05])


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.02, 0.01])
@pytest.mark.parametrize("i", [0, 1, 2])
def test_a_chain_with_enough_lines_is_smooth(ratio: float, i: int) -> None:
    assert _along(_chain(ratio), np.ones(3), _CHAIN_TRUTH, i).verdict == "smooth"


@pytest.mark.slow
@pytest.mark.parametrize("i", [0, 1, 2, 3])
def test_a_frame_with_enough_lines_is_smooth(i: int) -> None:
    assert _along(_frame(0.02), _FRAME_START, _FRAME_TRUTH, i).verdict == "smooth"


@pytest.mark.parametrize("i", [0, 2])
def test_modes_that_cross_single_lines_are_found(i: int) -> None:
    found = _along(_chain(0.002, np.array([5.0, 11.0, 17.0, 23.0, 28.0, 33.0])), np.ones(3), _CHAIN_TRUTH, i)
    assert found.verdict == "rough"
    assert found.holds < 0.02


@pytest.mark.slow
def test_functions_that_vanish_by_symmetry_are_found() -> None:
    """Where bottom and top are alike, a force along x at the middle of the cross bar does not move it along y."""
    frame, hz, middle = DenseFrame.made(), np.geomspace(20.0, 200.0, 120), 30

    def functions(x: Reals) -> Complexes:
        return frame.frfs(x, np.array([3 * middle + 1]), np.array([3 * middle]), hz, 0.02)

    start, truth = np.array([1.04, 0.98, 1.0, 1.0]), np.array([1.1, 0.95, 1.0, 1.0])
    found = _along(functions, start, truth, 0)
    assert found.verdict == "rough"


def _confined(ratio: float) -> float:
    """Confined modulus over Young's modulus."""
    return (1.0 - ratio) / ((1.0 + ratio) * (1.0 - 2.0 * ratio))


@pytest.mark.parametrize(("upper", "verdict"), [(0.45, "smooth"), (0.4999, "rough")])
@pytest.mark.slow
def test_a_rubber_layer_whose_poisson_ratio_comes_near_one_half(tmp_path: Path, upper: float, verdict: str) -> None:
    """A mass on confined rubber: the frequency is that of the confined modulus."""
    lines = ["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", "EIGRL,1,,,3", "SPC1,1,3,1,2,3,4"]
    for k in range(4):
        for j, (x, y) in enumerate([(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]):
            lines.append(f"GRID,{4 * k + j + 1},,{x},{y},{0.01 * k:.2f},,12456")
    for k in range(3):
        n = [4 * k + j for j in range(1, 9)]
        lines.append(f"CHEXA,{k + 1},1,{','.join(map(str, n[:6]))},+\n+,{n[6]},{n[7]}")
    lines += ["PSOLID,1,1", "MAT1,1,5.+6,,.42,1100.", *(f"CONM2,{90 + j},{13 + j},,5." for j in range(4))]
    (tmp_path / "rubber.bdf").write_text("\n".join([*lines, "ENDDATA", ""]))
    k, m = 5e6 * _confined(0.44) * 0.01 / 0.03, 20.0
    hz = np.geomspace(20.0, 400.0, 200)
    w, own = 2.0 * np.pi * hz, np.sqrt(k / m)
    measured = -(w**2) / (k - m * w**2 + 2j * 0.02 * m * own * w)
    point = DofSet.parse(["13Z+"])
    frfs = FrfSet(hz, measured[None, None], point, point, "accelerance")
    frame = WireFrame(np.array([13]), np.array([[0.0, 0.0, 0.03]]))
    write_uff_frfs(tmp_path / "frfs.uff", ModalTest("rubber", SI, frame, frfs=frfs))
    (tmp_path / "study.toml").write_text(
        f"""
[study]
title = "Rubber"
deck = "rubber.bdf"
units = "m-kg-s"
[test]
file = "frfs.uff"
[modes]
count = 2
[[parameter]]
name = "nu"
fields = ["MAT1 1 NU"]
lower = 0.40
upper = {upper}
absolute = true
[[parameter]]
name = "E"
fields = ["MAT1 1 E"]
lower = 0.8
upper = 1.2
[[residual]]
kind = "frf"
ratio = 0.02
[select]
smoothness = true
"""
    )
    found = ft.select(tmp_path / "study.toml")
    by_name = {s.parameter: s for s in found.record.smoothness}
    assert by_name["E"].verdict == "smooth"
    assert by_name["E"].sentence == ""
    assert by_name["nu"].verdict == verdict
    told = " ".join(found.record.sentences)
    assert ("not smooth along nu" in told) == (verdict != "smooth")


def test_kinks_jumps_and_several_minima() -> None:
    def jump(x: float) -> tuple[float, float]:
        return (x * x + (1.0 if x > 0.37 else 0.0)), 2.0 * x

    found = line_smoothness("x", jump, -1.0, 1.0)
    assert (found.verdict, found.holds) == ("rough", 0.0)
    assert found.where == pytest.approx(0.37, abs=0.02)
    waves = line_smoothness("x", lambda x: (np.cos(6.0 * x), -6.0 * np.sin(6.0 * x)), -1.0, 1.0)
    assert waves.verdict == "several minima"
    assert waves.minima == pytest.approx([-np.pi / 6.0, np.pi / 6.0], abs=0.15)
    none = line_smoothness("x", lambda x: None, -1.0, 1.0)
    assert (none.verdict, none.failed) == ("no solution", 9)
