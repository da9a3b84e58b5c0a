"""Decompose the stiffness of a beam element into eigenvalues: python run.py [--quick] [--evidence DIR].

The stiffness of a beam element in its plane is decomposed, K = Φ κ Φᵀ. There are two rigid-body modes without
stiffness, and two modes with strain, κ = 2EI/l and EI(24/l³ + 6/l), which are 2 and 30 for EI = l = 1. Then κ are
parameters: both are changed, and the rigid-body modes remain.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from numpy.typing import NDArray

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE
from femtune.fem import Structure
from femtune.fem.assemble import assemble
from femtune.fem.fields import generic_ref
from femtune.fem.generic import GenericGroup, GenericModes, generic_modes, with_generic
from femtune.model import Assignment, Configuration, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from structures.frames import bars, make_structure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Reals = NDArray[np.float64]
NAME = "cases_beam_element"
GROUP = GenericGroup("BEAM", frozenset([1]), components="26")
CASES = ((1.0, 1.0), (1.0, 0.25), (7.0, 0.3), (2.1e5, 4.0))
FACTORS = (0.4, 1.8)


def element(EI: float, length: float) -> Structure:
    """One beam along x that bends in the plane x-y."""
    section = {"E": EI, "G": EI, "A": 1.0, "I1": 1.0, "I2": 1.0, "J": 1.0, "rho": 1.0}
    return make_structure([[0, 0, 0], [length, 0, 0]], [bars([[0, 1]], section)])


def textbook(EI: float, length: float) -> Reals:
    """Stiffness of the Euler beam on (v₁, θ₁, v₂, θ₂)."""
    a, b, c = 6.0 * length, 4.0 * length**2, 2.0 * length**2
    return EI / length**3 * np.array([[12, a, -12, a], [a, b, -a, c], [-12, -a, 12, -a], [a, c, -a, b]])


def closed_form(EI: float, length: float) -> Reals:
    """The two eigenvalues that are not zero."""
    return np.array([2.0 * EI / length, EI * (24.0 / length**3 + 6.0 / length)])


def rigid_motions(length: float) -> Reals:
    """(4, 2) translation, and rotation about end 1."""
    return np.array([[1.0, 0.0], [0.0, 1.0], [1.0, length], [0.0, 1.0]])


def decomposition_error(EI: float, length: float) -> float:
    """Largest relative difference of κ from the closed form, and of Φ κ Φᵀ from the textbook's matrix."""
    modes, K = generic_modes(element(EI, length), GROUP), textbook(EI, length)
    assert modes.rigid == 2
    back = modes.shapes * modes.kappa @ modes.shapes.T
    of_kappa = np.abs(modes.kappa / np.sort(closed_form(EI, length)) - 1.0).max()
    return float(max(of_kappa, np.abs(back - K).max() / np.abs(K).max()))


def strain_of_rigid_motion(EI: float, length: float) -> float:
    """Force of the rigid-body motions over the largest stiffness, with both κ and a rotation of the shapes changed."""
    structure = with_generic(element(EI, length), GROUP, ["K1", "K2", "S1-2"])
    names = ("K1", "K2", "S1-2")
    values = ParameterSet((*(Parameter(n, 1.0, 0.1, 3.0) for n in ("a", "b")), Parameter("s", 0.0, -1.0, 1.0)))
    chosen = [Assignment(p, generic_ref("BEAM", n), n != "S1-2") for p, n in zip(("a", "b", "s"), names)]
    model = parametric_model(structure, values, chosen)
    held = Configuration(supports_added=((1, "1345"), (2, "1345")))
    x = values.normalise([*FACTORS, 0.5])
    K = configure(model, held).at(x).stiffness.toarray()
    wanted = np.sort(closed_form(EI, length)) * FACTORS
    np.testing.assert_allclose(np.linalg.eigvalsh(K)[2:], np.sort(wanted), rtol=1e-11)
    return float(np.abs(K @ rigid_motions(length)).max() / np.abs(K).max())


def check() -> list[tuple[float, float, float, float]]:
    """EI, l, error of the decomposition, and force of rigid motion, for each case."""
    unit = generic_modes(element(1.0, 1.0), GROUP)
    np.testing.assert_allclose(unit.kappa, [2.0, 30.0], rtol=1e-13)
    found = [(EI, length, decomposition_error(EI, length), strain_of_rigid_motion(EI, length)) for EI, length in CASES]
    assert max(row[2] for row in found) < 1e-12
    assert max(row[3] for row in found) < 1e-12
    plane = assemble(element(1.0, 1.0), "stiffness").toarray()[np.ix_([1, 5, 7, 11], [1, 5, 7, 11])]
    np.testing.assert_allclose(plane, textbook(1.0, 1.0), atol=1e-13)
    return found


def deflection(shape: Reals, x: Reals) -> Reals:
    """Cubic between the ends of a beam of unit length from (v₁, θ₁, v₂, θ₂)."""
    N = np.array([1 - 3 * x**2 + 2 * x**3, x - 2 * x**2 + x**3, 3 * x**2 - 2 * x**3, x**3 - x**2])
    return np.asarray(shape @ N)


def figure(modes: GenericModes) -> str:
    """The four shapes of the unit element, and κ over the length."""

    def draw(sheet: Figure) -> None:
        left, right = sheet.subplots(1, 2, width_ratios=(1.2, 1.0))
        _shapes(left, modes)
        _over_length(right)

    return draw_svg(8.2, 2.9, draw)


def _shapes(axes: Axes, modes: GenericModes) -> None:
    x = np.linspace(0.0, 1.0, 101)
    rigid = -np.linalg.qr(rigid_motions(1.0) @ np.array([[1.0, -0.5], [0.0, 1.0]]))[0]
    rows = [(rigid[:, 0], "κ = 0", INK), (rigid[:, 1], "κ = 0", INK),
            (modes.shapes[:, 0], "κ = 2", BLUE), (modes.shapes[:, 1], "κ = 30", ORANGE)]  # fmt: skip
    for i, (shape, words, colour) in enumerate(rows):
        axes.plot(x + 1.25 * i, 0 * x, color=LINE, linewidth=0.8)
        axes.plot(x + 1.25 * i, deflection(shape, x), color=colour, linewidth=1.6)
        axes.text(0.5 + 1.25 * i, -1.0, words, ha="center", color=colour)
    axes.set_ylim(-1.1, 0.9)
    axes.set_axis_off()
    axes.set_title("Shapes of the element, EI = l = 1")


def _over_length(axes: Axes) -> None:
    length = np.geomspace(0.1, 10.0, 61)
    kappa = np.array([closed_form(1.0, one) for one in length])
    found = np.array([generic_modes(element(1.0, one), GROUP).kappa for one in length[::6]])
    for i, colour in enumerate((BLUE, ORANGE)):
        axes.loglog(length, kappa[:, i], color=colour, linewidth=1.2)
        axes.loglog(length[::6], found[:, i], "o", color=colour, markersize=3)
    axes.text(0.16, 2.5, "2EI/l", color=BLUE)
    axes.text(0.35, 1.5e3, "EI(24/l³ + 6/l)", color=ORANGE)
    axes.set_xticks([0.1, 1.0, 10.0], [".1", "1", "10"])
    axes.set_yticks([1.0, 100.0, 1e4], ["1", "100", "10,000"])
    axes.set_xlabel("l")
    axes.set_title("κ over the length, EI = 1")
    axes.grid(True)


def text(found: list[tuple[float, float, float, float]]) -> str:
    """The page."""
    rows = []
    for EI, length, error, force in found:
        first, second = closed_form(EI, length)
        rows.append(f"| {EI:g} | {length:g} | 0, 0, {first:.6g}, {second:.6g} | {error:.0e} | {force:.0e} |")
    return "\n".join([
        "# Eigenvalues of a beam element", "",
        "The stiffness of a beam in its plane, decomposed into eigenvalues and eigenvectors, K = Φ κ Φᵀ, compared "
        "with the closed-form solution 0, 0, 2EI/l, EI(24/l³ + 6/l); then both κ multiplied by 0.4 and 1.8 and the "
        "eigenvectors rotated by 0.5 rad.", "",
        "| EI | l | eigenvalues | error of κ and of Φ κ Φᵀ | force of rigid-body motion after the change |",
        "| --- | --- | --- | --- | --- |", *rows, "",
        f"![Eigenvectors and eigenvalues of a beam element]({NAME}.svg)", "",
        "The eigenvalues combine forces per displacement and moments per rotation: which of the two is larger "
        "depends on the unit of length, and so do the eigenvectors. [Theory](../theory/parameterisation.md).", "",
    ])  # fmt: skip


def main() -> None:
    """Check, print, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the same as the full form, which takes seconds")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    arguments = parser.parse_args()
    page = text(check())
    print(page)
    if arguments.evidence:
        (arguments.evidence / f"{NAME}.md").write_text(page, encoding="utf-8")
        svg = figure(generic_modes(element(1.0, 1.0), GROUP))
        (arguments.evidence / f"{NAME}.svg").write_text(svg, encoding="utf-8")


if __name__ == "__main__":
    main()
