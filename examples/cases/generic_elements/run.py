"""Update a joint with the eigenvalues of a generic element: python run.py [--quick] [--evidence DIR].

The three beams again, with an offset of 0.8 of the true one. The elements at both joints are one generic element
K = Φ κ Φᵀ; κ₁ and κ₂ are updated with modes 2 and 3. Mode 1, in which the joints have little strain, remains 2.7 % too
low: parameters that fit the data are not necessarily the cause. With the offset itself as parameter all modes agree.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE, PALE
from femtune.dofs import Dof, DofSet
from femtune.fem import Structure
from femtune.fem.fields import generic_ref
from femtune.fem.generic import GenericGroup, GenericModes, generic_modes, with_generic
from femtune.fem.offsets import with_offsets
from femtune.modal import ModeSet
from femtune.model import Assignment, ConfiguredModel, EigenSolution, configure, parametric_model, solve_modes
from femtune.parameters import Parameter, ParameterSet, tied
from femtune.residuals import ComparedCase, FrequencyResidual, UpdateProblem
from femtune.updating import update
from structures.beams import CLAMPED, MIDDLE, OFFSET_M, OFFSETS, three_beams
from structures.iterations import iterations_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Reals = NDArray[np.float64]
NAME = "cases_generic_elements"
JOINTS = GenericGroup("JOINT", frozenset([3, 4, 7, 8]), components="126")
SHARE, MODES, USED = 0.8, 5, (1, 2)
RATIOS, FIRST_PERCENT = (0.9962, 1.0215), -2.7
"""Eigenvalue ratios of an independent solution, and where mode 1 stays."""
DOFS = DofSet(Dof(n, d) for n in range(2, 11) for d in ("X", "Y"))


@dataclass(frozen=True, eq=False)
class Found:
    """Parameters by name, and errors of the first five frequencies before and after, in %."""

    values: dict[str, float]
    before: Reals
    after: Reals


def rows_of(configured: ConfiguredModel) -> sp.csr_array:
    """The free DOFs at the sensors."""
    nodes = configured.model.structure.nodes
    return sp.csr_array(configured.transformation[[nodes.dof(d.node, d.component) for d in DOFS]])


def truth() -> tuple[EigenSolution, ModeSet]:
    """Modes of the true beams, and what is measured of them."""
    configured = configure(parametric_model(three_beams(), ParameterSet(()), ()), CLAMPED)
    found = solve_modes(configured.at(np.zeros(0)), MODES)
    shapes = rows_of(configured) @ found.shapes[:, :MODES]
    return found, ModeSet(found.freq_hz[:MODES], shapes, DOFS)


def updated(structure: Structure, values: ParameterSet, chosen: Iterable[Assignment], used: tuple[int, ...]) -> Found:
    """The parameters from the frequencies of some modes; the others are predictions."""
    true, test = truth()
    configured = configure(parametric_model(structure, values, chosen), CLAMPED)
    left = {i: "kept for comparison" for i in range(MODES) if i not in used}
    case = ComparedCase(configured, test, rows_of(configured), left, count=8)
    result = update(UpdateProblem((case,), values, (FrequencyResidual(1e-3),)))
    assert result.status.ok, result.status
    before, after = (solve_modes(configured.at(x), 8).freq_hz[:MODES] for x in (np.zeros(len(values.free)), result.x))
    return Found(result.values, *(100.0 * (f / true.freq_hz[:MODES] - 1.0) for f in (before, after)))


def by_kappa(mass_offset_m: float | None) -> Found:
    """Two eigenvalues of the joints, with the mass on the wrong offset too (None) or on the right one."""
    structure = with_generic(three_beams(SHARE * OFFSET_M, mass_offset_m), JOINTS, ["K1", "K2"])
    values = ParameterSet(tuple(Parameter(f"kappa_{i}", 1.0, 0.5, 2.0) for i in USED))
    chosen = [Assignment(f"kappa_{i}", generic_ref("JOINT", f"K{i}")) for i in USED]
    return updated(structure, values, chosen, USED)


def by_offset() -> Found:
    """The offset itself, from the same two modes."""
    structure = with_offsets(three_beams(SHARE * OFFSET_M), MIDDLE)
    values = ParameterSet((Parameter("a", SHARE * OFFSET_M, 0.005, 0.05, "m"), tied("field", "-a")))
    return updated(structure, values, [Assignment("field", ref, False) for ref in OFFSETS], USED)


PUBLISHED_MODES, HEAVY, ITERATIONS = 10, 13_000.0, 40
WEIGHT = 0.15
"""Of the side constraint: mean of the diagonal of Gᵀ W G, times this. The chapter's weight is lost in print; with this
one the parameters converge after about twenty iterations, as its figures show."""


@dataclass(frozen=True, eq=False)
class Run:
    """κ₁ and κ₂, and the errors of ten frequencies in %, over the iterations, with the iteration of convergence."""

    kappa: Reals
    errors: Reals
    converged: int


def published_run() -> Run:
    """Equation (22) with ten frequencies, those of modes 2 and 3 weighted by 13,000, and regularised steps."""
    structure = with_generic(three_beams(SHARE * OFFSET_M, OFFSET_M), JOINTS, ["K1", "K2"])
    values = ParameterSet(tuple(Parameter(f"kappa_{i}", 1.0, 0.5, 2.0) for i in USED))
    chosen = [Assignment(f"kappa_{i}", generic_ref("JOINT", f"K{i}")) for i in USED]
    configured = configure(parametric_model(structure, values, chosen), CLAMPED)
    true = solve_modes(
        configure(parametric_model(three_beams(), ParameterSet(()), ()), CLAMPED).at(np.zeros(0)), PUBLISHED_MODES
    ).freq_hz[:PUBLISHED_MODES]
    W = np.ones(PUBLISHED_MODES)
    W[list(USED)] = HEAVY
    x, at, errors, side = np.zeros(2), [], [], 0.0
    for _ in range(ITERATIONS + 1):
        found = solve_modes(configured.at(x), PUBLISHED_MODES)
        error = found.freq_hz[:PUBLISHED_MODES] / true - 1.0
        at.append(1.0 + x)
        errors.append(100.0 * error)
        G = np.array([
            (solve_modes(configured.at(x + d), PUBLISHED_MODES).freq_hz[:PUBLISHED_MODES]
             - solve_modes(configured.at(x - d), PUBLISHED_MODES).freq_hz[:PUBLISHED_MODES]) / (2e-4 * true)
            for d in 1e-4 * np.eye(2)
        ]).T  # fmt: skip
        H = G.T @ (W[:, None] * G)
        # chosen at the first iteration and kept
        side = side or WEIGHT * float(np.trace(H)) / 2.0
        x = x - np.linalg.solve(H + side * np.eye(2), G.T @ (W * error))
    kappa = np.array(at)
    away = np.abs(kappa / kappa[-1] - 1.0).max(axis=1)
    return Run(kappa, np.array(errors), int(np.flatnonzero(away > 1e-3)[-1]) + 1)


def check_run(run: Run, right_mass: Found) -> None:
    """Modes 2 and 3 converge in about twenty iterations, and mode 1 stays where it is."""
    assert np.abs(run.errors[-1][list(USED)]).max() < 0.1, run.errors[-1]
    assert abs(run.errors[-1][0] - FIRST_PERCENT) < 0.05
    assert 15 <= run.converged <= 25, run.converged
    two = [right_mass.values[f"kappa_{i}"] for i in USED]
    np.testing.assert_allclose(run.kappa[-1], two, atol=0.002)


def run_figure(run: Run) -> str:
    """κ and frequency errors over the iterations."""
    names = [f"mode {i + 1}" for i in (0, *USED)]
    return iterations_svg([
        ("κ / initial κ", ["κ₁", "κ₂"], run.kappa.T.tolist(), run.kappa[-1].tolist()),
        ("error of the frequency, %", names, run.errors[:, [0, *USED]].T.tolist(), [0.0] * 3),
    ])  # fmt: skip


def check(joint: Found, right_mass: Found, offset: Found, modes: GenericModes) -> None:
    """Everything that the example claims."""
    assert (modes.multiplicity == 2).all()
    assert modes.rigid == 6
    for found in (joint, right_mass):
        assert np.abs(found.after[list(USED)]).max() < 1e-6
        assert abs(found.after[0] - FIRST_PERCENT) < 0.05
    ratios = np.array([joint.values[f"kappa_{i}"] for i in USED])
    np.testing.assert_allclose(ratios, RATIOS, atol=0.004)
    assert abs(offset.values["a"] / OFFSET_M - 1.0) < 1e-7
    assert np.abs(offset.after).max() < 1e-6


def text(joint: Found, right_mass: Found, offset: Found, modes: GenericModes, run: Run) -> str:
    """The page."""
    listed = ", ".join(f"{k:.4g}" for k in modes.kappa)
    names = [f"κ₁ = {f.values['kappa_1']:.4f}, κ₂ = {f.values['kappa_2']:.4f}" for f in (joint, right_mass)]
    rows = [
        _row("offset 0.8 of the true one", joint.before),
        _row(names[0], joint.after),
        _row(f"{names[1]}, mass on the true offset", right_mass.after),
        _row(f"a = {1e3 * offset.values['a']:.3f} mm", offset.after),
    ]
    heads = " | ".join(f"mode {i}" + (", used" if i - 1 in USED else "") for i in range(1, MODES + 1))
    return "\n".join([
        "# A joint as a generic element", "",
        "Three beams, the middle one with an offset of 25 mm; the model has 20 mm. Elements 3, 4 and 7, 8 at both "
        f"joints are a generic element: its eigenvalues occur in pairs, {listed}, in addition to six rigid-body "
        "modes. Frequency errors in %, after an update with modes 2 and 3:", "",
        f"| parameters | {heads} |", "|---" * (MODES + 1) + "|", *rows, "",
        f"![Errors of the frequencies]({NAME}.svg)", "",
        f"An independent solution has the ratios {RATIOS[0]} and {RATIOS[1]}, and a mode 1 that is {-FIRST_PERCENT} "
        "% too low, as here. The ratios depend on the weighting of the modes and on whether the mass also has the "
        "wrong offset; the error of mode 1 does not. Two eigenvalues fit the two modes that were used, and the mode "
        "in which the joints have little strain shows that they are not the cause: keep such modes for validation.", "",
        f"The published run: ten frequencies, those of modes 2 and 3 weighted by {HEAVY:,.0f}, with a side constraint "
        f"on each step. Its weight is lost in print; with {WEIGHT:g} times the mean diagonal of GᵀWG, κ is within a "
        f"thousandth of its end after {run.converged} iterations (published: about 20), at "
        f"{run.kappa[-1][0]:.4f} and {run.kappa[-1][1]:.4f}, the mass on the true offset. Errors of the first five "
        f"frequencies then: {', '.join(f'{e:+.3f}' for e in run.errors[-1][:5])} %.", "",
        f"![κ and frequencies over the iterations]({NAME}_iterations.svg)", "",
    ])  # fmt: skip


def _row(name: str, errors: Reals) -> str:
    return f"| {name} | " + " | ".join(f"{e:+.3f}" if abs(e) > 5e-4 else "0" for e in errors) + " |"


def figure(joint: Found, offset: Found) -> str:
    """Errors of the frequencies before and after, a group of bars a mode."""
    kinds = (("offset 0.8 of the true one", joint.before, PALE), ("κ₁ and κ₂ of the joints", joint.after, ORANGE),
             ("the offset", offset.after, BLUE))  # fmt: skip

    def draw(sheet: Figure) -> None:
        axes = sheet.subplots()
        for k, (label, errors, colour) in enumerate(kinds):
            axes.bar(np.arange(MODES) + 0.25 * (k - 1), errors, 0.22, color=colour, label=label)
            small = np.flatnonzero(np.abs(errors) < 1e-3)
            axes.plot(small + 0.25 * (k - 1), 0.0 * small, "o", color=colour, markersize=3.5)
        axes.axhline(0.0, color=INK, linewidth=0.7)
        names = [f"mode {i}" + (" (used)" if i - 1 in USED else "") for i in range(1, MODES + 1)]
        axes.set_xticks(range(MODES), names)
        axes.set_ylabel("error of the frequency, %")
        axes.grid(True, axis="y", color=LINE)
        axes.set_axisbelow(True)
        axes.legend(frameon=False, loc="lower right")

    return draw_svg(7.2, 2.9, draw)


def main() -> None:
    """Update, compare, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the same as the full form, which takes seconds")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    arguments = parser.parse_args()
    modes = generic_modes(three_beams(SHARE * OFFSET_M), JOINTS)
    joint, right_mass, offset = by_kappa(None), by_kappa(OFFSET_M), by_offset()
    check(joint, right_mass, offset, modes)
    run = published_run()
    check_run(run, right_mass)
    page = text(joint, right_mass, offset, modes, run)
    print(page)
    if arguments.evidence:
        (arguments.evidence / f"{NAME}.md").write_text(page, encoding="utf-8")
        (arguments.evidence / f"{NAME}.svg").write_text(figure(joint, offset), encoding="utf-8")
        (arguments.evidence / f"{NAME}_iterations.svg").write_text(run_figure(run), encoding="utf-8")


if __name__ == "__main__":
    main()
