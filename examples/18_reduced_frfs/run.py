"""Calibrate a shell frame from FRFs on a reduced model: python run.py [--quick] [--evidence DIR].

A welded frame has six regions, whose thickness and modulus vary within ±25 %. A reduced model is trained for FRFs
between two inputs and some sensors. Its FRFs are compared with those of the full model at random points, and the
parameters are found from simulated FRFs, which are direct solutions of the full model.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import numpy as np

from femtune.files.nastran import build_structure, read_deck
from femtune.modal import FrfSet, half_band_lines
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    configure,
    constant_damping,
    parametric_model,
    solve_modes,
)
from femtune.model.reduce import FunctionsWanted, Trained, Trainer, TrainingRules, reduced_functions, reduced_modes
from femtune.model.reduce.function_estimate import log_difference
from femtune.model.response import Ports, frf, frf_gradient, make_ports
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import FrfResidual, ModelWay, UpdateProblem, case_without_modes, frf_residual
from femtune.updating import ReducedUpdate, ReductionRules, SensitivityMethod, update_reduced
from structures.ladder_frame import shell_frame, shell_frame_parameters
from structures.meshed import write_structure

WIDTH, ZETA = 0.25, 0.02
BAND = (90.0, 300.0)
SD = 0.05


@dataclass(frozen=True)
class Size:
    """DOFs, sensors of three directions, random points, tolerance of the training."""

    n_dofs: int
    sensors: int
    points: int
    tolerance: float


QUICK = Size(2_500, 4, 3, 1e-3)
FULL = Size(4_000, 16, 6, 5e-4)


def frame(n_dofs: int) -> ConfiguredModel:
    """The frame, read from a deck, with its twelve parameters."""
    with tempfile.TemporaryDirectory() as folder:
        deck = write_structure(shell_frame(n_dofs), Path(folder) / "frame.bdf")
        structure = build_structure(read_deck(deck)).structure
    fields = shell_frame_parameters()
    names = [f"{ref.name}{ref.id}" for ref in fields]
    parameters = ParameterSet(tuple(Parameter(n, 1.0, 1.0 - WIDTH, 1.0 + WIDTH) for n in names))
    return configure(
        parametric_model(structure, parameters, [Assignment(*p) for p in zip(names, fields)]), Configuration()
    )


def ports_of(configured: ConfiguredModel, sensors: int) -> Ports:
    """Sensors spread over the frame, two of whose directions are driven."""
    nodes = np.random.default_rng(0).choice(configured.model.structure.nodes.ids, sensors, replace=False)
    outputs = [f"{n}{d}+" for n in nodes for d in "XYZ"]
    return make_ports(configured, [outputs[2], outputs[10]], outputs)


@dataclass(frozen=True, eq=False)
class Compared:
    """Errors of the logarithm at random points after each full solution: root mean square, largest, and estimate."""

    orders: list[int]
    mean: np.ndarray
    largest: np.ndarray
    estimate: np.ndarray


def compare(size: Size, configured: ConfiguredModel, wanted: FunctionsWanted, count: int) -> Compared:
    """Train, and look at random points after every full solution."""
    points = np.random.default_rng(7).uniform(-WIDTH, WIDTH, (size.points, 12))
    exact = [_full(configured, wanted, x) for x in points]
    orders, rows = list[int](), list[list[tuple[float, float, float]]]()

    def look(trained: Trained) -> None:
        orders.append(trained.model.order)
        rows.append([_errors(trained, wanted, x, full) for x, full in zip(points, exact)])
        print(f"  order {orders[-1]}: {max(r[0] for r in rows[-1]):.4f}", flush=True)

    trainer = Trainer(configured, TrainingRules(count, size.tolerance, 12, 900, 24), report=look, functions=(wanted,))
    trainer.train(trainer.start())
    mean, largest, estimate = np.moveaxis(np.array(rows), 2, 0)
    return Compared(orders, mean, largest, estimate)


def _full(configured: ConfiguredModel, wanted: FunctionsWanted, x: np.ndarray) -> np.ndarray:
    """By superposition of the full model's modes, with residual vectors at inputs and outputs."""
    solved = solve_modes(configured.at(x), wanted.damped)
    found = frf_gradient(solved, wanted.ports, wanted.freq_hz, "receptance", damping=wanted.damping, derivatives=False)
    return np.asarray(found.frfs.values)


def _errors(trained: Trained, wanted: FunctionsWanted, x: np.ndarray, full: np.ndarray) -> tuple[float, float, float]:
    found = reduced_functions(
        reduced_modes(trained.model.at(x)), wanted.on(trained.basis), 2j * np.pi * wanted.freq_hz, wanted.damped,
        wanted.damping, derivatives=False,
    )  # fmt: skip
    values = np.moveaxis(found.values, 0, -1)
    estimate = trained.estimator.at(trained.model, trained.basis, x).function_error
    return log_difference(values, full), float(np.abs(np.log(values / full)).max()), estimate


def problem_of(configured: ConfiguredModel, test: FrfSet, damped: int) -> UpdateProblem:
    """The FRFs of the test as the only residual."""
    way = ModelWay(damping=constant_damping(ZETA), modes=(damped, None))
    residual, _ = frf_residual(solve_modes(configured.at(np.zeros(12)), damped), test, way=way)
    assert isinstance(residual, FrfResidual)
    case = case_without_modes(configured, (residual,), count=damped)
    return UpdateProblem((case,), configured.model.parameters)


def calibrate(problem: UpdateProblem, tolerance: float) -> ReducedUpdate:
    """On reduced models, from the nominal values; the full model's derivatives at the start are not needed."""
    x = np.zeros(12)
    start = problem.assess(x, problem.solved(x), derivatives=False)
    rules = ReductionRules(tolerance=0.1 * tolerance)
    return update_reduced(problem, SensitivityMethod(), rules, start=start)


def evidence(size: Size) -> str:
    """Compare, calibrate, check the goals, and say all of it."""
    configured = frame(size.n_dofs)
    ports, lines = ports_of(configured, size.sensors), half_band_lines(BAND, ZETA)
    modes = solve_modes(configured.at(np.zeros(12)), None, 2.0 * BAND[1])
    wanted = FunctionsWanted(ports, lines, modes.wanted, constant_damping(ZETA))
    found = compare(size, configured, wanted, int((modes.freq_hz <= 1.1 * BAND[1]).sum()) + 1)
    truth = np.random.default_rng(3).uniform(-0.15, 0.15, 12)
    solved = solve_modes(configured.at(truth), modes.wanted)
    test = frf(solved, ports, lines, "accelerance", "direct", damping=constant_damping(ZETA))
    problem = problem_of(configured, test, modes.wanted)
    began = time.process_time()
    ended = calibrate(problem, size.tolerance)
    seconds = time.process_time() - began
    assert ended.functions is not None
    assert ended.search is not None
    error = float(np.abs(ended.result.x - truth).max())
    times = _times(problem, ended)
    assert ended.certified
    assert found.mean[-1].max() < size.tolerance / 0.02
    assert error < 1e-4
    assert (found.estimate > 0.3 * found.mean).all()
    return "\n".join([*_head(size, configured, ports, lines, modes.wanted), *_table(found), "## Calibration", "",
        "The test FRFs are direct solutions of the full model at random values within ±15 %, without noise; the search "
        f"begins at the nominal values. It ends {'certified' if ended.certified else 'without a certificate'} after "
        f"{ended.cases[0].full_solutions} full solutions and {seconds:.0f} s of CPU time.", "",
        *(f"- {sentence}" for sentence in ended.rounds), "",
        "| | measured |", "| --- | --- |",
        f"| largest error of a parameter, relative to its nominal value | {error:.1e} |",
        f"| order at the end | {ended.search.trained[0].model.order} |",
        f"| residuals and Jacobian with the reduced model ({times[3]:,} values, 12 parameters), CPU s | "
        f"{times[0]:.3f} |",
        f"| residuals alone with the full model, CPU s | {times[1]:.2f} |",
        f"| residuals and Jacobian with the full model, CPU s | {times[2]:.1f} |",
        f"| ratio of full to reduced, residuals and Jacobian | {times[2] / times[0]:.0f} |", "",
    ])  # fmt: skip


def _times(problem: UpdateProblem, ended: ReducedUpdate) -> tuple[float, float, float, int]:
    """CPU seconds of residuals and Jacobian on the reduced model, of residuals on the full one, and of both there."""
    assert ended.search is not None
    reduced, x = ended.search.reduced_problem(), 0.5 * ended.result.x
    reduced.start(x)
    began = time.process_time()
    found = reduced.start(x)
    between = time.process_time()
    problem.assess(x, problem.solved(x), derivatives=False)
    without = time.process_time()
    problem.assess(x, problem.solved(x))
    return between - began, without - between, time.process_time() - without, len(found.residuals)


def _head(size: Size, configured: ConfiguredModel, ports: Ports, lines: np.ndarray, damped: int) -> list[str]:
    outputs, inputs = len(ports.output_labels), len(ports.input_labels)
    return [
        "# FRF calibration on a reduced model", "",
        f"A welded frame of shells with {configured.n_free:,} free DOFs; thickness and Young's modulus of six regions "
        f"within ±{100 * WIDTH:.0f} % (12 parameters). FRFs from {inputs} inputs to {outputs} outputs at {len(lines)} "
        f"lines between {BAND[0]:g} and {BAND[1]:g} Hz, three in each half bandwidth; damping ratio {100 * ZETA:g} % "
        f"of the {damped} modes up to twice the highest line.", "",
        "## Error at random points", "",
        f"The logarithm of reduced over full FRFs at {size.points} random points within the bounds, none of them a "
        "candidate of the training. The full FRFs are superposed from modes and residual vectors at inputs and "
        "outputs.",
        "",
    ]  # fmt: skip


def _table(found: Compared) -> list[str]:
    rows = [
        f"| {i} | {order} | {mean.max():.4f} | {mean.mean():.4f} | {largest.max():.3f} | {(estimate / mean).min():.2f} "
        f"to {(estimate / mean).max():.2f} |"
        for i, (order, mean, largest, estimate) in enumerate(
            zip(found.orders, found.mean, found.largest, found.estimate), start=1
        )
    ]
    head = "| full solutions | order | worst RMS of a point | mean RMS | largest of one value | estimate / true RMS |"
    return [head, "| --- | --- | --- | --- | --- | --- |", *rows, ""]


def main() -> None:
    """Print the evidence, and write it where asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--evidence", type=Path)
    given = parser.parse_args()
    text = evidence(QUICK if given.quick else FULL)
    print(text)
    if given.evidence is not None:
        given.evidence.mkdir(parents=True, exist_ok=True)
        (given.evidence / "18_reduced_frfs.md").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
