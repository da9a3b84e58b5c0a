"""Update the half-widths of a T-joint with a rigid core: python run.py [--quick] [--evidence DIR].

Three members meet in a joint whose core is rigid over a half-width x along the beam and y along the stem. The motion of
the joint is transferred to the members by u = u₀ − yθ, v = v₀ ± xθ. The example compares the matrices with the
closed-form solution, checks that rigid-body motions cause no strain and that frequencies increase with both offsets,
and updates both half-widths with four frequencies.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE, PALE
from femtune.dofs import Dof, DofSet
from femtune.fem import FieldRef, Structure
from femtune.fem.offsets import with_offsets
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.parameters import DerivedQuantity, Parameter, ParameterSet, parse_expression, tied
from femtune.residuals import ComparedCase, FrequencyResidual, UpdateProblem
from femtune.updating import UpdateResult, update
from structures.frames import bars, make_structure, masses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Reals = NDArray[np.float64]
NAME = "cases_t_joint"
SPAN, STEM = 0.5, 0.4
"""From the joint to the ends of the beam on either side, and to the foot of the stem, m."""
SECTION = {"E": 2.1e11, "G": 8.1e10, "A": 4e-4, "I1": 1.3e-8, "I2": 1.3e-8, "J": 2e-8, "rho": 0.0}
TRUE, START = (0.045, 0.030), (0.02, 0.02)
PLANE = tuple((n, "345") for n in range(1, 5))
CLAMPED = Configuration(supports_added=((1, "126"), (2, "126"), *PLANE))
FREE = Configuration(supports_added=PLANE)
DOFS = DofSet(Dof(n, d) for n in (3, 4) for d in ("X", "Y"))
USED = 4


def structure() -> Structure:
    """Members 1 and 2 along x and 3 down, joint at grid point 4; masses at the joint and at the foot."""
    points = [[-SPAN, 0.0, 0.0], [SPAN, 0.0, 0.0], [0.0, -STEM, 0.0], [0.0, 0.0, 0.0]]
    members = bars([[3, 0], [3, 1], [3, 2]], SECTION, orientation=(0.3, 1.0, 0.0))
    lumps = masses([3, 2], {"M": [4.0, 2.5], "I33": [0.012, 0.006]})
    return with_offsets(make_structure(points, [members, lumps]), (1, 2, 3))


def model(configuration: Configuration) -> ConfiguredModel:
    """Half-widths x and y of the core: the ends of the members at the joint lie at (∓x, 0) and (0, −y)."""
    parameters = ParameterSet((
        Parameter("x", START[0], 0.0, 0.15, "m"), Parameter("y", START[1], 0.0, 0.15, "m"),
        tied("left", "-x"), tied("down", "-y"),
    ))  # fmt: skip
    fields = (("left", 1, "W1A"), ("x", 2, "W1A"), ("down", 3, "W2A"))
    chosen = [Assignment(name, FieldRef("CBAR", e, field), False) for name, e, field in fields]
    return configure(parametric_model(structure(), parameters, chosen), configuration)


def member(length: complex, angle: float) -> NDArray:
    """(6, 6) textbook stiffness of a plane frame member from end a to end b."""
    EA, EI = SECTION["E"] * SECTION["A"] / length, SECTION["E"] * SECTION["I1"] / length**3
    a, b, c = 6.0 * length, 4.0 * length**2, 2.0 * length**2
    k = np.zeros((6, 6), np.result_type(length))
    k[np.ix_([0, 3], [0, 3])] = EA * np.array([[1, -1], [-1, 1]])
    bend = EI * np.array([[12, a, -12, a], [a, b, -a, c], [-12, -a, 12, -a], [a, c, -a, b]])
    k[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = bend
    turn = np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    T = np.kron(np.eye(2), turn)
    return np.asarray(T.T @ k @ T)


def closed_form(x: complex, y: complex) -> NDArray:
    """(12, 12) on (u, v, θ) of the points 1 to 4: members from the core's faces, carried to the joint."""
    K = np.zeros((12, 12), np.result_type(x, y))
    faces = ((0, SPAN - x, np.pi, (-x, 0.0)), (1, SPAN - x, 0.0, (x, 0.0)), (2, STEM - y, -np.pi / 2, (0.0, -y)))
    for point, length, angle, (rx, ry) in faces:
        # the face moves by u₀ − r_y θ and v₀ + r_x θ
        T = np.zeros((6, 12), K.dtype)
        T[:3, 9:] = [[1.0, 0.0, -ry], [0.0, 1.0, rx], [0.0, 0.0, 1.0]]
        T[3:, 3 * point : 3 * point + 3] = np.eye(3)
        K += T.T @ member(length, angle) @ T
    return K


def rigid_motions() -> Reals:
    """(12, 3) two translations and a rotation about the joint."""
    points = np.array([[-SPAN, 0.0], [SPAN, 0.0], [0.0, -STEM], [0.0, 0.0]])
    rows = [np.array([[1.0, 0.0, -p[1]], [0.0, 1.0, p[0]], [0.0, 0.0, 1.0]]) for p in points]
    return np.vstack(rows)


def matrix_errors(free: ConfiguredModel) -> tuple[float, float]:
    """Largest relative difference from the closed form, and force of rigid motion over the stiffness, at "
    "many (x, y)."""
    errors, forces = [], []
    for x, y in [(0.0, 0.0), TRUE, START, (0.15, 0.02), (0.01, 0.14)]:
        K, wanted = free.at(free.model.parameters.normalise([x, y])).stiffness.toarray(), closed_form(x, y)
        errors.append(np.abs(K - wanted).max() / np.abs(wanted).max())
        forces.append(np.abs(K @ rigid_motions()).max() / np.abs(K).max())
    return float(max(errors)), float(max(forces))


def derivative_error(free: ConfiguredModel) -> float:
    """Derivatives of the stiffness by x and y against complex steps of the closed form."""
    values, worst = free.model.parameters, 0.0
    exact = [d.toarray() for d in free.at(values.normalise(TRUE)).stiffness_derivatives]
    for i, step in enumerate(1e-30j * np.eye(2)):
        found = closed_form(*(np.array(TRUE) + step)).imag / 1e-30 * values.scale[i]
        worst = max(worst, float(np.abs(found - exact[i]).max() / np.abs(found).max()))
    return worst


def frequencies(clamped: ConfiguredModel, x: float, y: float) -> Reals:
    """All six, Hz."""
    return solve_modes(clamped.at(clamped.model.parameters.normalise([x, y])), 6).freq_hz[:6]


@dataclass(frozen=True, eq=False)
class Found:
    """The update, and the area of the core that follows, with its standard deviation, cm²."""

    result: UpdateResult
    area_cm2: float
    sd_cm2: float


def found_again(clamped: ConfiguredModel) -> Found:
    """Both half-widths from four frequencies of the true joint, known to 0.2 %."""
    values, nodes = clamped.model.parameters, clamped.model.structure.nodes
    true = solve_modes(clamped.at(values.normalise(TRUE)), 6)
    rows = sp.csr_array(clamped.transformation[[nodes.dof(d.node, d.component) for d in DOFS]])
    test = ModeSet(true.freq_hz[:USED], rows @ true.shapes[:, :USED], DOFS)
    result = update(UpdateProblem((ComparedCase(clamped, test, rows, count=6),), values, (FrequencyResidual(0.002),)))
    area = DerivedQuantity("core", parse_expression("4e4*x*y"), "cm²").at(values, result.x)
    return Found(result, float(area.value), result.spread(area.grad))


def check(clamped: ConfiguredModel, free: ConfiguredModel, found: Found) -> None:
    """Everything that the example claims."""
    error, force = matrix_errors(free)
    assert error < 1e-13
    assert force < 1e-14
    assert derivative_error(free) < 1e-12
    for path in ([(s, 0.03) for s in (0.0, 0.03, 0.06, 0.1)], [(0.045, s) for s in (0.0, 0.03, 0.06, 0.1)]):
        for one, other in pairwise(frequencies(clamped, *p) for p in path):
            assert (other > one).all(), path
    assert found.result.status.ok, found.result.status
    values, sd = found.result.values, found.result.sd
    np.testing.assert_allclose([values["x"], values["y"]], TRUE, rtol=1e-6)
    # independent of the gradient: the area's spread from the covariance of x and y, by its two partial derivatives
    C = found.result.covariance.matrix * np.outer(clamped.model.parameters.scale, clamped.model.parameters.scale)
    g = 4e4 * np.array([TRUE[1], TRUE[0]])
    np.testing.assert_allclose(found.sd_cm2, np.sqrt(g @ C @ g), rtol=1e-5)
    np.testing.assert_allclose([sd["x"], sd["y"]], np.sqrt(np.diag(C)), rtol=1e-9)


def text(clamped: ConfiguredModel, free: ConfiguredModel, found: Found) -> str:
    """The page."""
    error, force = matrix_errors(free)
    values, sd = found.result.values, found.result.sd
    rows = [
        f"| {1e3 * x:.0f} | {1e3 * y:.0f} | " + " | ".join(f"{f:.2f}" for f in frequencies(clamped, x, y)) + " |"
        for x, y in [(0.0, 0.0), (0.02, 0.02), TRUE, (0.10, 0.03), (0.045, 0.10)]
    ]
    return "\n".join([
        "# A T-joint with a rigid core", "",
        "Two members of a beam and a stem meet in a core that is rigid over a half-width x along the beam and y "
        "along the stem. The offsets are fields of the bars (W1A, W2A) and change their lengths.", "",
        f"- Stiffness compared with the closed-form solution at five pairs (x, y): {error:.0e} of the largest entry.",
        f"- Force of rigid-body motion: {force:.0e} of the largest entry, for all x and y.",
        "- Derivatives compared with complex-step derivatives of the closed-form solution: "
        f"{derivative_error(free):.0e}.", "",
        "Ends of the beam clamped, masses at the joint and at the foot: all frequencies increase with both offsets.",
        "",
        "| x, mm | y, mm | " + " | ".join(f"mode {i}, Hz" for i in range(1, 7)) + " |", "|---" * 8 + "|", *rows, "",
        "From four frequencies with a standard deviation of 0.2 % and initial values of 20 and 20 mm: x = "
        f"{1e3 * values['x']:.2f} ± {1e3 * sd['x']:.2f} mm (true 45), y = {1e3 * values['y']:.2f} ± "
        f"{1e3 * sd['y']:.2f} mm (true 30), and the area of the core as a derived quantity, {found.area_cm2:.2f} ± "
        f"{found.sd_cm2:.2f} cm².", "",
        f"![The joint, and its frequencies over the offsets]({NAME}.svg)", "",
    ])  # fmt: skip


def figure(clamped: ConfiguredModel) -> str:
    """The joint, and frequencies over x and over y."""

    def draw(sheet: Figure) -> None:
        left, middle, right = sheet.subplots(1, 3, width_ratios=(1.2, 1.0, 1.0))
        _joint(left)
        widths = np.linspace(0.0, 0.1, 21)
        _over(middle, widths, np.array([frequencies(clamped, w, TRUE[1]) for w in widths]), "x, mm")
        _over(right, widths, np.array([frequencies(clamped, TRUE[0], w) for w in widths]), "y, mm")
        middle.set_ylabel("frequency over that without offset")

    return draw_svg(9.0, 2.9, draw)


def _joint(axes: Axes) -> None:
    x, y = TRUE
    axes.fill([-x, x, x, -x], [-y, -y, y, y], facecolor=PALE, edgecolor=INK, linewidth=0.8)
    for a, b in (((-SPAN, 0), (-x, 0)), ((x, 0), (SPAN, 0)), ((0, -y), (0, -STEM))):
        axes.plot([a[0], b[0]], [a[1], b[1]], color=BLUE, linewidth=2.0)
    for end in (-SPAN, SPAN):
        axes.plot([end, end], [-0.06, 0.06], color=INK, linewidth=2.5)
    axes.plot([0.0, 0.0], [0.0, -STEM], "o", color=ORANGE, markersize=7)
    axes.text(0.0, 0.06, "2x", ha="center", color=INK)
    axes.text(x + 0.02, -y - 0.05, "2y", color=INK)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title("rigid core, masses, clamped ends")


def _over(axes: Axes, widths: Reals, freq: Reals, label: str) -> None:
    for i in range(freq.shape[1]):
        colour = (BLUE, ORANGE, INK)[i % 3]
        axes.plot(1e3 * widths, freq[:, i] / freq[0, i], color=colour, linewidth=1.2, linestyle="-" if i < 3 else "--")
    _names(axes, 1e3 * widths[-1] + 1.5, freq[-1] / freq[0], 2 * (BLUE, ORANGE, INK))
    axes.set_xlabel(label)
    axes.grid(True, color=LINE)


def _names(axes: Axes, x: float, ends: Reals, colours: Sequence[str]) -> None:
    """Numbers of the modes beside the ends of their curves, moved apart where they would touch."""
    low, high = axes.get_ylim()
    order, least, last = np.argsort(ends), 0.055 * (high - low), -np.inf
    for i in order:
        last = max(float(ends[i]), last + least)
        axes.text(x, last, f"{i + 1}", color=colours[i], va="center")


def main() -> None:
    """Check, print, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the same as the full form, which takes seconds")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    arguments = parser.parse_args()
    clamped, free = model(CLAMPED), model(FREE)
    found = found_again(clamped)
    check(clamped, free, found)
    page = text(clamped, free, found)
    print(page)
    if arguments.evidence:
        (arguments.evidence / f"{NAME}.md").write_text(page, encoding="utf-8")
        (arguments.evidence / f"{NAME}.svg").write_text(figure(clamped), encoding="utf-8")


if __name__ == "__main__":
    main()
