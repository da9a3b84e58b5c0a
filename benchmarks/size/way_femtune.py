"""femtune from the deck to the re-solve, stage by stage."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from checks import check_modes, hertz
from counting import counted
from exact_derivatives import derivative_error
from numpy.typing import NDArray
from stages import Stages
from summary import CHANGED
from workspace import Workspace

from cases import MODES, changed, compiled, sensor_rows
from femtune.files.nastran import build_structure, read_deck
from femtune.model import (
    Configuration,
    ConfiguredModel,
    EigenSolution,
    ModelPoint,
    SubspaceDerivative,
    configure,
    solve_modes,
    subspace_derivative,
)
from femtune.model.reduce.estimate import orthonormal
from femtune.model.reduce.modes_in_basis import reduced_modes
from femtune.model.reduce.reduced_model import reduce_model
from femtune.model.solvers.factorise import analyse

_TOGETHER = 1e-6


def run(space: Workspace, shift: float | None) -> dict[str, Any]:
    """All stages, then the checks, whose cost is not counted."""
    stages = Stages()
    model = _model(space, stages)
    solution = _solution(model, stages)
    derivatives = _derivatives(solution, sensor_rows(model), stages)
    again = _modes(_matrices(model, changed(solution.point.n_parameters), CHANGED, stages), solution, CHANGED, stages)
    reduced = _reduced(model, solution, again, stages)
    # what is checked needs no factors of before: they would fill the memory at the largest sizes
    solution, again = (replace(found, known_factor=None, sturm_factor=None) for found in (solution, again))
    return {"stages": stages.measured, **_checked(solution, again, derivatives), "reduced_model": reduced}


def _model(space: Workspace, stages: Stages) -> ConfiguredModel:
    with stages.stage("read deck"):
        structure = build_structure(read_deck(space.deck)).structure
    with stages.stage("terms"):
        parametric = compiled(space.case, structure)
    with stages.stage("configure"):
        return configure(parametric, Configuration())


def _matrices(model: ConfiguredModel, x: NDArray, suffix: str, stages: Stages) -> ModelPoint:
    point = model.at(x)
    with stages.stage("K and M" + suffix):
        assert point.symmetric_stiffness.shape == point.symmetric_mass.shape
    return point


def _solution(model: ConfiguredModel, stages: Stages) -> EigenSolution:
    """At the nominal parameters."""
    point = _matrices(model, np.zeros(len(model.model.parameters.free)), "", stages)
    with stages.stage("analyse"):
        analysis = analyse(point.symmetric_stiffness)
    with stages.stage("factorise"):
        factor = analysis.factorise(point.symmetric_stiffness.plus(1.0, point.symmetric_mass))
    del factor, analysis
    return _modes(point, None, "", stages)


def _modes(point: ModelPoint, start: EigenSolution | None, suffix: str, stages: Stages) -> EigenSolution:
    """The old solution lives on beside the new one, with the factors that it keeps."""
    name = "50 modes" + suffix
    with stages.stage(name), counted() as counts:
        solution = solve_modes(point, MODES, start=start)
    stages.into(name, **counts.rounded())
    return solution


def clusters(values: NDArray, shift: float) -> list[list[int]]:
    """Modes one by one, those that are repeated (rigid-body modes, too) together."""
    out = [[0]]
    for i in range(1, len(values)):
        if values[i] - values[i - 1] <= _TOGETHER * (values[i] - shift):
            out[-1].append(i)
        else:
            out.append([i])
    return out


def _derivatives(solution: EigenSolution, rows: Any, stages: Stages) -> list[SubspaceDerivative]:
    """Of all wanted eigenvalues, and of their vectors at the sensors."""
    groups = clusters(solution.eigenvalues[: solution.wanted], solution.shift)
    with stages.stage("derivatives"):
        return [subspace_derivative(solution, group, rows) for group in groups]


def _reduced(model: ConfiguredModel, solution: EigenSolution, again: EigenSolution, stages: Stages) -> dict[str, float]:
    """The terms on the modes of both points; its frequencies at the second are compared with those of the model."""
    point = solution.point
    with stages.stage("reduced model"):
        metric = point.symmetric_stiffness.plus(-solution.shift, point.symmetric_mass)
        basis = orthonormal(np.hstack([solution.shapes, again.shapes]), metric)
        reduced = reduce_model(model, basis)
    with stages.stage("reduced modes"):
        found = reduced_modes(reduced.at(again.point.x), MODES).eigenvalues[:MODES]
    wanted = again.eigenvalues[:MODES]
    elastic = wanted > 1e-6 * wanted[-1]
    error = np.abs(np.sqrt(found[elastic] / wanted[elastic]) - 1.0).max()
    return {"order": reduced.order, "frequency_error": float(error)}


def _checked(solution: EigenSolution, again: EigenSolution, derivatives: list[SubspaceDerivative]) -> dict[str, Any]:
    """What is compared with the other ways, and what is wrong."""
    checks, wrong = {}, []
    for name, found in (("nominal", solution), ("changed", again)):
        point = found.point
        pair = point.symmetric_stiffness, point.symmetric_mass
        checks[name] = check_modes(pair, found.shift, found.eigenvalues[:MODES], found.shapes[:, :MODES])
        wrong.append(checks[name].wrong())
        below = int((found.eigenvalues < found.sturm_shift).sum())
        if found.sturm_count != below:
            wrong.append(f"{below} modes where the Sturm count says {found.sturm_count}")
    error = derivative_error(solution, derivatives, clusters(solution.eigenvalues[: solution.wanted], solution.shift))
    return {
        "shift": solution.shift,
        "freq_hz": [hertz(s.eigenvalues[:MODES]).tolist() for s in (solution, again)],
        "checks": {name: vars(found) for name, found in checks.items()},
        "sturm": [solution.sturm_count, again.sturm_count],
        "derivative_error": error,
        "wrong": "; ".join(text for text in wrong if text),
    }
