"""A reduced model of a shell frame beside the full one at random points: python run.py [--quick] [--evidence DIR].

A welded frame of six regions, thickness and Young's modulus of each within ±25 %. A reduced model is trained on this
box and compared with the full model at points that the training has not seen. The full form has 40,000 DOF and takes
minutes.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femtune.files.nastran import build_structure, read_deck
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.model.products import derivative_product
from femtune.model.reduce import (
    ReducedModel,
    Trained,
    Trainer,
    TrainingRules,
    certified_error,
    reduce_model,
    reduced_modes,
)
from femtune.model.reduce.basis import extend
from femtune.parameters import Parameter, ParameterSet
from femtune.testing.subframe_deck import write_structure
from femtune.testing.subframe_frame import shell_frame, shell_frame_parameters

RIGID, WIDTH = 6, 0.25


@dataclass(frozen=True)
class Size:
    """DOFs, elastic modes, random points; what the training is asked for; errors that it must reach."""

    n_dofs: int
    elastic: int
    points: int
    tolerance: float
    full_solutions: int
    inner: int
    worst: float
    mean: float

    @property
    def count(self) -> int:
        """Modes with the rigid-body ones."""
        return self.elastic + RIGID


QUICK = Size(2_500, 12, 4, 2e-3, 8, 10, 1e-2, 1e-3)
FULL = Size(40_000, 40, 30, 1e-3, 15, 32, 3e-3, 2e-4)


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


@dataclass(frozen=True, eq=False)
class Compared:
    """Errors at random points (points, elastic), worst estimates (points,), and seconds of CPU of a solution."""

    errors: np.ndarray
    estimates: np.ndarray
    with_derivatives: np.ndarray
    full_s: float
    reduced_s: float

    @property
    def effectivity(self) -> np.ndarray:
        """(points,) worst estimate over worst error."""
        return self.estimates / self.errors.max(axis=1)


def compare(size: Size, trained: Trained, other: ReducedModel) -> Compared:
    """The reduced model and a model of derivative vectors beside the full one at random points."""
    configured = trained.model.configured
    errors, estimates, others, full_s, reduced_s = [], [], [], 0.0, 0.0
    for x in np.random.default_rng(2026).uniform(*configured.model.parameters.bounds, (size.points, 12)):
        begin = time.process_time()
        truth = solve_modes(configured.at(x), size.count).eigenvalues[: size.count]
        middle = time.process_time()
        reduced_modes(trained.model.at(x), size.count)
        full_s, reduced_s = full_s + middle - begin, reduced_s + time.process_time() - middle
        errors.append(certified_error(trained.model, x, truth)[RIGID:])
        estimates.append(trained.estimator.at(trained.model, trained.basis, x).worst)
        others.append(certified_error(other, x, truth)[RIGID:])
        print(f"  point {len(errors)}: worst {100 * errors[-1].max():.4f} %", flush=True)
    return Compared(
        np.array(errors), np.array(estimates), np.array(others), full_s / size.points, reduced_s / size.points
    )


def derivative_model(size: Size, start: Trained) -> ReducedModel:
    """The nominal modes with A0⁻¹(K′ − λM′)φ of every parameter, the vectors of a first-order expansion."""
    configured = start.model.configured
    point = configured.at(np.zeros(12))
    modes = reduced_modes(start.model.at(np.zeros(12)), size.count)
    phi, values = start.basis @ modes.shapes[:, : size.count], modes.eigenvalues[: size.count]
    basis = start.basis
    for i in range(12):
        force = derivative_product(point, "stiffness", i, phi) - derivative_product(point, "mass", i, phi) * values
        basis = extend(basis, start.estimator.factor.solve(np.asfortranarray(force)), start.metric, 5e-2)
    return reduce_model(configured, basis, None, start.model.shift)


def evidence(size: Size) -> str:
    """Train, compare, check the goals, and say all of it."""
    configured = frame(size.n_dofs)
    trainer = Trainer(
        configured, TrainingRules(size.count, size.tolerance, size.full_solutions, 900, size.inner), report=tell
    )
    start = trainer.start()
    trained = trainer.train(start)
    other = derivative_model(size, start)
    found = compare(size, trained, other)
    at = trained.certified[len(trained.certified) // 2]
    certified = float(certified_error(trained.model, at.x, at.eigenvalues).max())
    assert found.errors.max() < size.worst
    assert found.errors.mean() < size.mean
    assert certified < 1e-4
    assert found.effectivity.min() > 0.1
    return page(size, trained, found, certified, other.order)


def tell(trained: Trained) -> None:
    """One line for each full solution."""
    last = trained.certified[-1]
    print(
        f"  {len(trained.certified)}: order {last.order}, estimate {last.estimate:.2e}, true {last.error:.2e}",
        flush=True,
    )


def page(size: Size, trained: Trained, found: Compared, certified: float, other_order: int) -> str:
    """The page of the documentation."""
    ratio = found.effectivity
    percent = [f"{100 * v:.4f}" for v in (found.errors.max(), found.errors.mean())]
    other = [f"{100 * v:.3f}" for v in (found.with_derivatives.max(), found.with_derivatives.mean())]
    rows = [
        f"| {i} | {c.order} | {100 * c.estimate:.3f} | {100 * c.error:.3f} | {c.estimate / c.error:.2f} |"
        for i, c in enumerate(trained.certified[1:], start=2)
    ]
    first = trained.certified[0]
    return "\n".join([
        "# A reduced model beside the full one", "",
        f"A welded frame of shells with {trained.model.configured.n_free:,} free DOFs, thickness and Young's modulus "
        f"of six regions each within ±{100 * WIDTH:.0f} % (12 parameters); the first {size.elastic} elastic modes of "
        "the free frame.", "", "## Training", "",
        f"The nominal model starts the basis (order {first.order}). Estimate and true error are the worst of all modes "
        "at the point that was solved next, before its modes were added.", "",
        "| full solutions | order | estimate % | true error % | estimate / true |", "| --- | --- | --- | --- | --- |",
        *rows, "", f"It ended: {trained.status.value}; {len(trained.certified)} full solutions, order "
        f"{trained.model.order}.", "", "## Random points", "",
        f"{size.points} points drawn uniformly in the box, none of them a candidate of the training.", "",
        "| | measured | goal |", "| --- | --- | --- |",
        f"| worst frequency error % | {percent[0]} | {100 * size.worst:.2g} |",
        f"| mean frequency error % | {percent[1]} | {100 * size.mean:.2g} |",
        f"| error at a certified point % | {100 * certified:.5f} | 0.01 |",
        f"| estimate / true error, least | {ratio.min():.2f} | 0.1 |",
        f"| estimate / true error, median | {np.median(ratio):.2f} | |",
        f"| estimate / true error, most | {ratio.max():.2f} | |", "",
        f"Modes of the reduced model take {found.reduced_s:.2f} s of CPU, of the full model {found.full_s:.2f} s: "
        f"{found.full_s / found.reduced_s:.0f} times as long.", "",
        "In place of other points, the first derivatives of the nominal modes by all parameters (one full solution, "
        f"order {other_order}) err by {other[0]} % at worst and {other[1]} % on the average at the same points.", "",
    ])  # fmt: skip


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a small frame, for continuous integration")
    parser.add_argument("--evidence", type=Path, help="folder for the documentation's page")
    options = parser.parse_args()
    text = evidence(QUICK if options.quick else FULL)
    print(text)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "13_reduced_model.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
