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


# Two elements with pinned ends (Fig. 6): rotation of end 1, deflection and rotation in the middle, rotation of end 2.
PINNED_LENGTH = 2.0
"""Of each element: from about this length on the symmetric and the antisymmetric shapes alternate."""
MIRROR = np.array([[0, 0, 0, -1.0], [0, 1, 0, 0], [0, 0, -1, 0], [-1, 0, 0, 0]])
ANGLE, PINNED_FACTORS = 0.4, (0.5, 1.4, 0.8, 1.2)


def pinned(length: float) -> Reals:
    """(4, 4) stiffness of two equal elements, EI = 1, by the library."""
    section = {"E": 1.0, "G": 1.0, "A": 1.0, "I1": 1.0, "I2": 1.0, "J": 1.0, "rho": 1.0}
    two = make_structure([[i * length, 0, 0] for i in range(3)], [bars([[0, 1], [1, 2]], section)])
    K = assemble(two, "stiffness").toarray()
    at = [5, 7, 11, 17]
    return np.asarray(K[np.ix_(at, at)])


def pinned_closed_form(length: float) -> Reals:
    """Two symmetric and two antisymmetric eigenvalues, ascending."""
    a, b = length, length**3
    found = []
    for first, second, mixed in ((4 / a, 24 / b, -6 * np.sqrt(2) / a**2), (4 / a, 8 / a, 2 * np.sqrt(2) / a)):
        middle, half = 0.5 * (first + second), np.hypot(0.5 * (first - second), mixed)
        found += [middle - half, middle + half]
    return np.sort(found)


def rotated(shapes: Reals, kappa: Reals, angle: float) -> Reals:
    """Φ₀ S κ Sᵀ Φ₀ᵀ with an orthogonal S that mixes the two symmetric shapes, the first and the third."""
    S = np.eye(4)
    S[np.ix_([0, 2], [0, 2])] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return np.asarray(shapes @ S * kappa @ (shapes @ S).T)


def check_pinned() -> tuple[Reals, Reals]:
    """κ and Φ₀ of the two elements; five parameters keep the symmetry, and S is orthogonal."""
    K = pinned(PINNED_LENGTH)
    kappa, shapes = np.linalg.eigh(K)
    np.testing.assert_allclose(kappa, pinned_closed_form(PINNED_LENGTH), rtol=1e-12)
    mirrored = np.sign(np.sum(shapes * (MIRROR @ shapes), axis=0))
    # the first and third are symmetric, the second and fourth antisymmetric
    assert mirrored.tolist() == [1.0, -1.0, 1.0, -1.0], mirrored
    np.testing.assert_allclose(rotated(shapes, kappa, 0.0), K, atol=1e-12)
    changed = rotated(shapes, kappa * PINNED_FACTORS, ANGLE)
    np.testing.assert_allclose(np.linalg.eigvalsh(changed), np.sort(kappa * PINNED_FACTORS), rtol=1e-12)
    np.testing.assert_allclose(MIRROR @ changed @ MIRROR, changed, atol=1e-12)
    antisymmetric = shapes[:, [1, 3]]
    np.testing.assert_allclose(changed @ antisymmetric, antisymmetric * (kappa * PINNED_FACTORS)[[1, 3]], atol=1e-12)
    _check_group()
    return kappa, shapes


def _check_group() -> None:
    """The same five parameters as a group of the library, without supports: κ₁ … κ₄ and S₁₋₃."""
    section = {"E": 1.0, "G": 1.0, "A": 1.0, "I1": 1.0, "I2": 1.0, "J": 1.0, "rho": 1.0}
    two = make_structure([[i * PINNED_LENGTH, 0, 0] for i in range(3)], [bars([[0, 1], [1, 2]], section)])
    group = GenericGroup("TWO", frozenset([1, 2]), components="26")
    modes = generic_modes(two, group)
    mirror = np.zeros((6, 6))
    for i, j in ((0, 4), (2, 2), (4, 0)):
        mirror[i, j], mirror[i + 1, j + 1] = 1.0, -1.0
    kinds = np.sign(np.sum(modes.shapes * (mirror @ modes.shapes), axis=0))
    first, other = np.flatnonzero(kinds > 0.0)[:2] + 1
    names = ("K1", "K2", "K3", "K4", f"S{first}-{other}")
    structure = with_generic(two, group, list(names))
    free = ParameterSet((*(Parameter(f"k{i}", 1.0, 0.1, 3.0) for i in range(1, 5)), Parameter("s", 0.0, -1.0, 1.0)))
    chosen = [Assignment(p.name, generic_ref("TWO", n), not n.startswith("S")) for p, n in zip(free.parameters, names)]
    model = parametric_model(structure, free, chosen)
    held = Configuration(supports_added=((1, "12345"), (2, "1345"), (3, "12345")))
    K = configure(model, held).at(free.normalise([*PINNED_FACTORS, ANGLE])).stiffness.toarray()
    # rotation 1, deflection and rotation 2, rotation 3
    np.testing.assert_allclose(MIRROR @ K @ MIRROR, K, atol=1e-11)
    assert np.abs(K - pinned(PINNED_LENGTH)).max() > 0.1


def pinned_figure(kappa: Reals, shapes: Reals) -> str:
    """The four shapes along both elements."""

    def draw(sheet: Figure) -> None:
        x = np.linspace(0.0, 1.0, 51)
        for axes, value, shape in zip(sheet.subplots(1, 4, sharey=True), kappa, shapes.T):
            ends = np.array([0.0, shape[0], shape[1], shape[2], 0.0, shape[3]])
            curve = [_curved(ends[2 * i : 2 * i + 4], x, PINNED_LENGTH) for i in (0, 1)]
            axes.plot(PINNED_LENGTH * np.concatenate([x, 1.0 + x]), np.concatenate(curve), color=BLUE)
            axes.axhline(0.0, color=LINE, linewidth=0.8)
            axes.set_title(f"κ = {value:.3f}")

    return draw_svg(8.2, 1.9, draw)


def _curved(ends: Reals, x: Reals, length: float) -> Reals:
    return deflection(ends * [1.0, length, 1.0, length], x)


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
    axes.set_xticks([0.1, 1.0, 10.0], ["0.1", "1", "10"])
    axes.set_yticks([1.0, 100.0, 1e4], ["1", "100", "10,000"])
    axes.set_xlabel("l")
    axes.set_title("κ over the length, EI = 1")
    axes.grid(True)


def text(found: list[tuple[float, float, float, float]], pinned_kappa: Reals) -> str:
    """The page."""
    listed = ", ".join(f"{k:.4g}" for k in pinned_kappa)
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
        "## Two elements with pinned ends", "",
        f"Two elements of length {PINNED_LENGTH:g} have four eigenvalues, {listed}, compared with the closed form: "
        "the first and third shape are symmetric, the second and fourth antisymmetric. Five parameters, all "
        "eigenvalues and an orthogonal S that mixes the first and third shape, keep the symmetry and the "
        "antisymmetric shapes (asserted, also for a group of the two elements in a model with supports).", "",
        f"![Eigenvectors of two elements with pinned ends]({NAME}_pinned.svg)", "",
    ])  # fmt: skip


def main() -> None:
    """Check, print, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the same as the full form, which takes seconds")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    arguments = parser.parse_args()
    kappa, shapes = check_pinned()
    page = text(check(), kappa)
    print(page)
    if arguments.evidence:
        (arguments.evidence / f"{NAME}.md").write_text(page, encoding="utf-8")
        svg = figure(generic_modes(element(1.0, 1.0), GROUP))
        (arguments.evidence / f"{NAME}.svg").write_text(svg, encoding="utf-8")
        (arguments.evidence / f"{NAME}_pinned.svg").write_text(pinned_figure(kappa, shapes), encoding="utf-8")


if __name__ == "__main__":
    main()
