"""Compare a reduced model of a shell frame with the full model: python run.py [--quick] [--evidence DIR].

A welded frame has six regions, whose thickness and Young's modulus vary within ±25 %. A reduced model is trained within
these bounds and compared with the full model at random points that were not used in the training. The full form has
40,000 DOFs and takes minutes.
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
from femtune.model.reduce.estimate import extend
from femtune.parameters import Parameter, ParameterSet
from structures.ladder_frame import shell_frame, shell_frame_parameters
from structures.meshed import write_structure

RIGID, WIDTH = 6, 0.25
NOTHING = 1e-5
"""Relative frequency error of single modes below which it does not matter whether the estimate sees it."""


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
FULL = Size(40_000, 40, 30, 1e-3, 15, 256, 3e-3, 2e-4)


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
    """Relative frequency errors at random points, and seconds of CPU of one solution and one estimate.

    Parameters
    ----------
    errors, estimates : (stages, points, elastic) true and estimated, a stage for each number of full solutions
    others : (points, elastic) of the basis of derivative vectors
    """

    errors: np.ndarray
    estimates: np.ndarray
    others: np.ndarray
    full_s: float
    reduced_s: float
    estimate_s: float

    @property
    def effectivity(self) -> np.ndarray:
        """(stages, points) worst estimate over worst error."""
        return np.asarray(self.estimates.max(axis=2) / self.errors.max(axis=2))

    @property
    def of_single_modes(self) -> np.ndarray:
        """Estimate over error of every mode at every stage and point where the error is worth a thought."""
        some = self.errors > NOTHING
        return np.asarray(self.estimates[some] / self.errors[some])


def compare(size: Size, trained: Trained, stages: list[ReducedModel], other: ReducedModel) -> Compared:
    """The reduced models of all stages and one of derivative vectors beside the full model at random points."""
    configured, seconds = trained.model.configured, np.zeros(3)
    errors, estimates, others = [], [], []
    for x in np.random.default_rng(2026).uniform(*configured.model.parameters.bounds, (size.points, 12)):
        times = [time.process_time()]
        truth = solve_modes(configured.at(x), size.count).eigenvalues[: size.count]
        times.append(time.process_time())
        errors.append([certified_error(model, x, truth)[RIGID:] for model in stages])
        times.append(time.process_time())
        # the columns of a basis are never turned, so that the first ones are the basis of an earlier stage
        bases = (trained.basis[:, : model.order] for model in stages)
        found = [trained.estimator.at(model, basis, x) for model, basis in zip(stages, bases)]
        times.append(time.process_time())
        seconds += np.diff(times)
        estimates.append([one.frequency_error[RIGID:] for one in found])
        others.append(certified_error(other, x, truth)[RIGID:])
        print(f"  point {len(errors)} of {size.points}: worst {100 * errors[-1][-1].max():.4f} %", flush=True)
    full_s, reduced_s, estimate_s = seconds / size.points / [1, len(stages), len(stages)]
    pairs = (np.swapaxes(np.array(v), 0, 1) for v in (errors, estimates))
    return Compared(*pairs, np.array(others), full_s, reduced_s, estimate_s)


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
    stages: list[ReducedModel] = []

    def keep(trained: Trained) -> None:
        stages.append(trained.model)
        tell(trained)

    rules = TrainingRules(size.count, size.tolerance, size.full_solutions, 900, size.inner)
    trainer = Trainer(configured, rules, report=keep)
    start = trainer.start()
    began = time.process_time()
    trained = trainer.train(start)
    trained_s = time.process_time() - began
    other = derivative_model(size, start)
    found = compare(size, trained, stages, other)
    certified = max(float(certified_error(trained.model, c.x, c.eigenvalues).max()) for c in trained.certified)
    assert found.errors[-1].max() < size.worst
    assert found.errors[-1].mean() < size.mean
    assert certified < 1e-4
    assert found.effectivity.min() > 0.1
    return "\n".join([*head(size, trained, trained_s), *stage_table(trained, found), *goals(size, found, certified),
                      *remarks(found, other.order)])  # fmt: skip


def tell(trained: Trained) -> None:
    """One line for each full solution."""
    last = trained.certified[-1]
    print(
        f"  {len(trained.certified)}: order {last.order}, estimate {last.estimate:.2e}, true {last.error:.2e}",
        flush=True,
    )


def head(size: Size, trained: Trained, trained_s: float) -> list[str]:
    """What was compared, and the training."""
    rows = [
        f"| {i} | {c.order} | {100 * c.estimate:.3f} | {100 * c.error:.3f} | {c.estimate / c.error:.2f} |"
        for i, c in enumerate(trained.certified[1:], start=2)
    ]
    return [
        "# A reduced model compared with the full model", "",
        f"A welded frame of shells with {trained.model.configured.n_free:,} free DOFs, thickness and Young's modulus "
        f"of six regions each within ±{100 * WIDTH:.0f} % (12 parameters); the first {size.elastic} elastic modes of "
        "the free frame.", "", "## Training", "",
        f"The nominal model gives the initial basis (order {trained.certified[0].order}). Estimate and true error "
        "are the largest of all modes at the next point that was solved, before its modes were added.", "",
        "| full solutions | order | estimate % | true error % | estimate / true |", "| --- | --- | --- | --- | --- |",
        *rows, "", (
            f"Training ended: {trained.status.value} (required estimate {100 * size.tolerance:.2g} %, {size.inner} "
            f"candidates); {len(trained.certified)} full solutions, order {trained.model.order}, {trained_s:.0f} s "
            "of CPU time after the nominal solution."
        ), "",
    ]  # fmt: skip


def stage_table(trained: Trained, found: Compared) -> list[str]:
    """Errors and estimates at the random points after every full solution."""
    rows = [
        f"| {i} | {c.order} | {100 * e.max():.4f} | {100 * e.mean():.4f} | {ratio.min():.2f} | {np.median(ratio):.2f} |"
        for i, (c, e, ratio) in enumerate(zip(trained.certified, found.errors, found.effectivity), start=1)
    ]
    return [
        "## Random points", "",
        f"{found.errors.shape[1]} random points, uniformly distributed within the bounds, none of them a candidate "
        "of the training; estimate / true is that of the frequency with the largest error at each point.", "",
        "| full solutions | order | largest error % | mean error % | estimate / true, smallest | median |",
        "| --- | --- | --- | --- | --- | --- |", *rows, "",
    ]  # fmt: skip


def goals(size: Size, found: Compared, certified: float) -> list[str]:
    """What was measured beside what was asked for."""
    last, ratio, modes = found.errors[-1], found.effectivity, found.of_single_modes
    return [
        "| at the end | measured | required |", "| --- | --- | --- |",
        f"| largest frequency error % | {100 * last.max():.4f} | {100 * size.worst:.2g} |",
        f"| mean frequency error % | {100 * last.mean():.4f} | {100 * size.mean:.2g} |",
        f"| error at the certified points, largest % | {100 * certified:.5f} | 0.01 |",
        f"| estimate / true error of all stages, smallest | {ratio.min():.2f} | 0.1 |",
        f"| estimate / true error of all stages, largest | {ratio.max():.2f} | |",
        f"| the same for single modes with errors above {100 * NOTHING:g} %, smallest | {modes.min():.3f} | |", "",
    ]  # fmt: skip


def remarks(found: Compared, other_order: int) -> list[str]:
    """What it costs, and what derivative vectors do."""
    other = [f"{100 * v:.3f}" for v in (found.others.max(), found.others.mean())]
    return [
        f"Modes of a reduced model take {found.reduced_s:.3f} s of CPU time, an error estimate "
        f"{found.estimate_s:.2f} s, the modes of the full model {found.full_s:.2f} s: "
        f"{found.full_s / found.reduced_s:.0f} times as long as those of the reduced model.", "",
        "With the first derivatives of the nominal modes by all parameters instead of other points (one full "
        f"solution, order {other_order}), the errors at the same points are at most {other[0]} % and {other[1]} % "
        "on average.", "",
    ]  # fmt: skip


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a small frame, for continuous integration")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    text = evidence(QUICK if options.quick else FULL)
    print(text)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "13_reduced_model.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
