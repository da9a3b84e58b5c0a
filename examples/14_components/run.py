"""Compare models of Craig-Bampton components with full models: python run.py [--quick] [--evidence DIR].

A cantilever of two halves is compared with the closed form. An exhaust system of two components and a clamp is compared
with its full model: errors and times for several numbers of component modes, at other values of the joint and of the
components, and in an update of the joint. The full form has 33,000 DOFs.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import numpy as np

from femtune.files.nastran import build_structure, read_deck
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.model.reduce import (
    Components,
    ComponentTrainer,
    TrainingRules,
    certified_error,
    component_model,
    divide,
    reduced_modes,
)
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import FrequencyResidual, ShapeResidual, UpdateProblem
from femtune.updating import ReductionRules, SensitivityMethod, UpdateResult, update, update_reduced
from structures.beams import I1, SECTION, exact_frequency, held_for_bending, straight_line
from structures.exhaust import FRONT, KNOWN, REAR, exhaust_deck, reference
from structures.frames import bars, make_structure
from structures.springs import simulated_case

COUNT = 26
"""Modes of the exhaust system, six of them rigid-body modes."""
JOINT, OF_REAR = ("k_bend", "k_twist"), ("E_rear", "E_muffler")
WIDTH = 0.4


@dataclass(frozen=True)
class Size:
    """Refinement of the exhaust system and number of random points."""

    finer: int
    points: int


QUICK, FULL = Size(1, 3), Size(5, 10)


def exhaust(finer: int) -> tuple[ConfiguredModel, Components]:
    """The whole system with stiffness parameters within ±40 %, and its two components; the clamp belongs to none."""
    known = [k for k in KNOWN if k.name in (*JOINT, *OF_REAR)]
    model = exhaust_deck(finer)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "exhaust.bdf"
        path.write_text(model.text, encoding="ascii")
        structure = build_structure(read_deck(path)).structure
    parameters = ParameterSet(
        tuple(Parameter(k.name, k.nominal, (1 - WIDTH) * k.nominal, (1 + WIDTH) * k.nominal) for k in known)
    )
    placed = [Assignment(k.name, reference(field), False) for k in known for field in k.fields]
    components = Components({name: frozenset(model.elements[name]) for name in (FRONT, REAR)})
    return configure(parametric_model(structure, parameters, placed), Configuration()), components


def closed_form() -> list[str]:
    """A cantilever of 64 Euler beams in two halves."""
    n, multiples = 64, (1.0, 2.0, 4.0, 8.0)
    xyz, pairs = straight_line(n)
    structure = make_structure(xyz, [bars(pairs, SECTION)], consistent_mass=True)
    held = np.array(sorted(held_for_bending(("clamped", "free"), n, 1)))
    beam = configure(parametric_model(replace(structure, permanent=held), ParameterSet(()), ()), Configuration())
    halves = {"left": frozenset(range(1, n // 2 + 1)), "right": frozenset(range(n // 2 + 1, n + 1))}
    near = solve_modes(beam.at(np.zeros(0)), 5).freq_hz
    exact = np.array([exact_frequency(("clamped", "free"), f, I1, 0.0, 0.0) for f in near])
    rows, errors = [], []
    for multiple in multiples:
        limits = dict.fromkeys(halves, multiple * float(exact[-1]))
        found = component_model(beam, Components(halves, limits), float(exact[-1]))
        error = reduced_modes(found.model.at(np.zeros(0)), 5).freq_hz / exact - 1.0
        errors.append(error.max())
        modes = " + ".join(str(p.modes) for p in found.components.parts)
        rows.append(f"| {multiple:g} | {modes} | {found.model.order} | {' | '.join(f'{100 * e:.4f}' for e in error)} |")
    assert np.min(errors) > -1e-9
    assert errors == sorted(errors, reverse=True)
    assert errors[1] < 6e-3
    assert errors[-1] < 2e-4
    return [
        "## A cantilever of two halves", "",
        f"{n} Euler beams with consistent mass, one component for each half, two interface DOFs. Errors in % of the "
        "first five bending frequencies from the roots of cos βL cosh βL = −1. The error is positive for every mode, "
        "because the reduced model is a Ritz approximation.", "",
        "| modes up to (times f5) | modes | order | f1 | f2 | f3 | f4 | f5 |", "| --- " * 8 + "|", *rows, "",
    ]  # fmt: skip


def timed(work: Callable[[], object], least: float = 0.2) -> float:
    """Seconds of one call, repeated for a while."""
    began, count = time.perf_counter(), 0
    while count == 0 or time.perf_counter() - began < least:
        work()
        count += 1
    return (time.perf_counter() - began) / count


def convergence(system: ConfiguredModel, components: Components) -> list[str]:
    """Errors at the nominal point, order and times beside the full model."""
    x = np.zeros(len(system.model.parameters.free))
    full = solve_modes(system.at(x), COUNT)
    values, high = full.eigenvalues[:COUNT], float(full.freq_hz[COUNT - 1])
    full_s = timed(lambda: solve_modes(system.at(x), COUNT))
    rows = [f"| full | | {system.n_free:,} | | | | {full_s:.3g} |"]
    errors = []
    for multiple in (1.0, 2.0, 4.0, 8.0):
        limited = replace(components, max_hz=dict.fromkeys(components.elements, multiple * high))
        found = component_model(system, limited, high)
        build_s = timed(lambda limited=limited: component_model(system, limited, high))  # type: ignore[misc]
        modes_s = timed(lambda model=found.model: reduced_modes(model.at(x), COUNT))  # type: ignore[misc]
        error = certified_error(found.model, x, values)[6:]
        errors.append(float(error.max()))
        modes = " + ".join(str(p.modes) for p in found.components.parts)
        rows.append(
            f"| {multiple:g} | {modes} | {found.model.order} | {100 * error.max():.4f} | {100 * error.mean():.4f} | "
            f"{build_s:.3g} | {modes_s:.3g} |"
        )
    assert errors == sorted(errors, reverse=True)
    assert errors[1] < 2e-2
    assert errors[-1] < 1e-3
    sizes = "; ".join(f"{p.part.name} {len(p.part.interior):,} DOFs" for p in found.components.parts)
    return [
        "## An exhaust system of two components", "",
        f"{sizes}; {len(found.components.interface)} interface DOFs at the two ends of the clamp, which belongs to no "
        f"component. {COUNT - 6} elastic modes up to {high:.0f} Hz; fixed-interface modes of the components up to a "
        "multiple of that. Times of one thread in seconds; building the components includes their factorisation.", "",
        "| modes up to (times f26) | modes | order | largest error % | mean error % | building s | modes of the "
        "assembly s |", "| --- " * 7 + "|", *rows, "",
    ]  # fmt: skip


def random_points(system: ConfiguredModel, components: Components, size: Size) -> list[str]:
    """Errors where the joint, and where a component is another one, before and after the training."""
    names = [p.name for p in system.model.parameters.free]
    rows, zero = [], np.zeros(len(names))
    division = divide(system, components)
    assert division is not None
    for what, moved in (("joint", JOINT), ("rear part", OF_REAR)):
        moving, random = np.isin(names, moved), np.random.default_rng(3)
        rules = TrainingRules(COUNT, 1e-3, 10, 600, inner=16)
        trainer = ComponentTrainer(system, rules, components, division, moving=moving)
        start = trainer.start()
        alone = component_model(system, components, float(solve_modes(system.at(zero), COUNT).freq_hz[-1])).model
        began = time.process_time()
        trained = trainer.train(start)
        seconds = time.process_time() - began
        errors = []
        for u in random.uniform(-1.0, 1.0, (size.points, len(names))):
            x = np.where(moving, WIDTH * u, 0.0)
            values = solve_modes(system.at(x), COUNT).eigenvalues[:COUNT]
            errors.append([certified_error(m, x, values)[6:].max() for m in (alone, start.model, trained.model)])
        assert trained.components is not None
        builds = [len(p.built) for p in trained.components.parts]
        worst = 100.0 * np.max(errors, axis=0)
        rows.append(
            f"| {what} | {alone.order} | {worst[0]:.4f} | {start.model.order} | {worst[1]:.4f} | "
            f"{', '.join(map(str, builds))} | {trained.model.order} | {worst[2]:.4f} | {seconds:.2g} |"
        )
        # what moves the joint changes no component, and what moves the rear part not the front
        assert builds == [1, 1] if what == "joint" else builds[0] == 1 < builds[1]
        assert len(trained.certified) == 1
        assert worst[2] < 0.01
    return [
        "## Other values of the parameters", "",
        f"{size.points} random points within ±{100 * WIDTH:.0f} %, for the stiffnesses of the joint and for Young's "
        "moduli of the tubes and the muffler of the rear part; modes of the components up to twice f26. Largest "
        "errors in % with the components alone; with the parts that the modes of the full model at the nominal point "
        "have in them, with which the training begins; and after the training, which computes components again at the "
        "points where the error estimate is largest. The number of points at which the front and the rear part were "
        "computed includes the nominal one, where the full model was solved; it was solved at no other point.",
        "",
        "| parameters | order, components | error % | with parts of full modes | error % | points (front, rear) | "
        "order after training | error % | training, CPU s |", "| --- " * 9 + "|", *rows, "",
    ]  # fmt: skip


def updates(system: ConfiguredModel, components: Components) -> list[str]:
    """The joint from simulated modes: with the full model, with a reduced model of the whole, with components."""
    names = [p.name for p in system.model.parameters.free]
    truth = np.where(np.isin(names, JOINT), 0.25, 0.0)
    exact = simulated_case(system, truth.tolist(), tuple(range(4, system.n_free, system.n_free // 60)), COUNT)
    elastic = slice(6, COUNT)
    test = replace(exact.test, freq_hz=exact.test.freq_hz[elastic], shapes=exact.test.shapes[:, elastic],
                   labels=exact.test.labels[elastic])  # fmt: skip
    problem = UpdateProblem(
        (replace(exact, test=test),), system.model.parameters, (FrequencyResidual(1e-3), ShapeResidual(0.01))
    )
    rows = []
    for what, rules in (
        ("full model", None),
        ("reduced model of the whole", ReductionRules()),
        ("components", ReductionRules(components=components)),
    ):
        began = time.process_time()
        result: UpdateResult
        if rules is None:
            result = update(problem, SensitivityMethod(), active=JOINT)
            order, solved, error = f"{system.n_free:,}", "", ""
        else:
            found = update_reduced(problem, SensitivityMethod(), rules, active=JOINT)
            assert found.certified
            result, (facts,) = found.result, found.cases
            order, solved, error = str(facts.order), str(facts.full_solutions), f"{100 * facts.certified_error:.4f}"
        seconds = time.process_time() - began
        off = float(np.abs(result.x - truth).max())
        assert off < 2e-3
        rows.append(f"| {what} | {order} | {solved} | {error} | {100 * off:.4f} | {seconds:.2g} |")
    return [
        "## Update of the joint", "",
        "Both stiffnesses of the joint from 20 simulated elastic modes without noise. At the end the reduced models "
        "are certified by the full model (largest error of a frequency 0.01 %). Full solutions: for training and "
        "certification.", "",
        "| search on | order | full solutions | certified error % | error of the parameters % | CPU s |",
        "| --- " * 6 + "|", *rows, "",
    ]  # fmt: skip


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a small model, for continuous integration")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    size = QUICK if options.quick else FULL
    system, components = exhaust(size.finer)
    text = "\n".join([
        "# Models assembled from Craig-Bampton components", "", *closed_form(), *convergence(system, components),
        *random_points(system, components, size), *updates(system, components),
    ])  # fmt: skip
    print(text)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "14_components.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
