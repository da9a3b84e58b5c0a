"""Compare the estimated error of a mesh with its true one: python run.py [--quick] [--evidence DIR].

The true error of a frequency is that against a mesh of the same elements with 64 a side (solids and tubes: less), whose
mode is found by its shape. Half of the structures have lumped, the others consistent mass, each in turn. Exits with a
status other than zero where fewer than `SHARE` of the estimates are within a factor of two of the true error.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import numpy as np

from femtune.arrays import Reals
from femtune.modal.assignment import linear_sum_assignment
from femtune.model import EigenSolution, solve_modes
from femtune.model.mesh_error import MeshChange, mesh_change
from structures.coarse import MeshedCase, box_beam, cases, curved_panel, solid_plate
from structures.shells import model_at_nominal

SHARE = 0.9
"""Part of the modes whose estimate must be within a factor of two."""
FLOOR = 0.001
"""Errors below this matter to nobody; the share without them is shown too."""
_MAC = 0.8
_ALIKE = 0.1
_MORE = 8


@dataclass(frozen=True)
class Compared:
    """One mode of one mesh: its case, elements a side, true and estimated error; NaN where no mode was found."""

    case: MeshedCase
    sides: int
    mode: int
    true: float
    estimate: float

    @property
    def good(self) -> bool:
        """Within a factor of two, and of the right sign."""
        return bool(0.5 <= self.estimate / self.true <= 2.0)


def translations(solution: EigenSolution) -> Reals:
    """(n, 3, m) of the grid points."""
    shapes = solution.point.configured.transformation @ solution.shapes[:, : solution.wanted]
    count = len(solution.point.configured.model.structure.nodes.ids)
    return np.asarray(shapes.reshape(count, 6, -1)[:, :3])


def nearest(points: Reals, of: Reals) -> np.ndarray:
    """(n,) rows of the points `of` that are nearest to some points."""
    return np.array([int(np.sum((of - p) ** 2, axis=1).argmin()) for p in points])


def partners(own: Reals, fine: Reals, freq_hz: Reals) -> list[int]:
    """The mode of the reference for each mode, −1 for none: the lowest of those that look alike at these points."""
    a, b = own.reshape(-1, own.shape[2]), fine.reshape(-1, fine.shape[2])
    with np.errstate(divide="ignore", invalid="ignore"):
        mac = np.nan_to_num((a.T @ b) ** 2 / np.outer((a * a).sum(axis=0), (b * b).sum(axis=0)))
    # a coarse mesh cannot tell a wave from one that is several times shorter
    best = mac.max(axis=1, keepdims=True)
    score = np.where(mac >= best - _ALIKE, 1.0, mac) - 1e-3 * np.arange(len(freq_hz)) / len(freq_hz)
    rows, columns = linear_sum_assignment(score, maximize=True)
    out = [-1] * len(mac)
    for i, j in zip(rows, columns):
        out[i] = int(j) if mac[i, j] >= _MAC else -1
    return out


def compare(case: MeshedCase, sides: Iterable[int], reference: int) -> Iterator[Compared]:
    """All modes of all meshes of a case."""
    most = case.rigid + 6
    fine = solve_modes(model_at_nominal(case.build(reference)), most + _MORE)
    fine_xyz, fine_shapes = fine.point.configured.model.structure.nodes.xyz, translations(fine)
    for n in sides:
        count = case.rigid + case.modes(n)
        solution = solve_modes(model_at_nominal(case.build(n)), count)
        found = mesh_change(solution)
        assert isinstance(found, MeshChange), (case, n, found)
        structure = solution.point.configured.model.structure
        shown = fine_shapes[nearest(structure.nodes.xyz, fine_xyz)]
        elastic = slice(case.rigid, None)
        other = partners(translations(solution)[..., elastic], shown[..., elastic], fine.freq_hz[elastic])
        for k, j in enumerate(other):
            i = case.rigid + k
            if i < len(found.error):
                true = np.nan if j < 0 else solution.freq_hz[i] / fine.freq_hz[case.rigid + j] - 1.0
                yield Compared(case, n, i + 1, float(true), float(found.error[i]))


def shares(title: str, found: list[Compared], of: Callable[[Compared], str]) -> list[str]:
    """A table: how many are within a factor of two, by a property."""
    groups: dict[str, list[Compared]] = defaultdict(list)
    for c in found:
        groups[of(c)].append(c)
    lines = [
        f"\n| {title} | modes | within a factor of 2 | of those with an error above {100 * FLOOR:g} % |",
        "|---|---|---|---|",
    ]
    lines += [_line(name, group) for name, group in groups.items()]
    return [*lines, _line("**all**", found)]


def _line(name: str, found: list[Compared]) -> str:
    large = [c for c in found if abs(c.true) > FLOOR]
    return f"| {name} | {len(found)} | {_share(found)} | {_share(large)} |"


def _share(found: list[Compared]) -> str:
    return f"{100 * np.mean([c.good for c in found]):.0f} % of {len(found)}" if found else "–"


def worst(found: list[Compared]) -> list[str]:
    """The estimates that are not within a factor of two, the largest true errors first."""
    bad = sorted((c for c in found if not c.good and abs(c.true) > FLOOR), key=lambda c: -abs(c.true))
    lines = [
        "\n| structure | element | mass | a side | mode | true error % | estimate % |",
        "|---|---|---|---|---|---|---|",
    ]
    for c in bad:
        mass = "consistent" if c.case.coupled else "lumped"
        lines.append(
            f"| {c.case.name} | {c.case.cells} | {mass} | {c.sides} | {c.mode} | {100 * c.true:+.3g} | "
            f"{_percent(c.estimate)} |"
        )
    return lines


def _percent(estimate: float) -> str:
    return f"{100 * estimate:+.3g}" if np.isfinite(estimate) else "no mode alike"


def costs() -> list[str]:
    """Processor seconds of the modes and of the estimate."""
    builds = {
        "curved panel, CQUAD4": lambda n: curved_panel(n, "quad", False, "clamped"),
        "box beam, CQUAD4": lambda n: box_beam(n // 4, "quad", False),
        "curved panel, CQUAD8": lambda n: curved_panel(n // 2, "quad8", False, "clamped"),
        "solid plate, CHEXA": lambda n: solid_plate(n // 2, "hexa8", False),
    }
    lines = ["\n| model | free DOFs | refined | 20 modes, s | estimate, s |", "|---|---|---|---|---|"]
    for name, build in builds.items():
        for n in (16, 32):
            structure, begun = build(n), process_time()
            solution = solve_modes(model_at_nominal(structure), 20)
            solved = process_time()
            found = mesh_change(solution)
            assert isinstance(found, MeshChange)
            times = f"{solved - begun:.2f} | {process_time() - solved:.2f}"
            lines.append(f"| {name} | {solution.point.configured.n_free} | {found.free_dofs} | {times} |")
    return lines


_TEXT = """# Error of the mesh: estimated and true

The estimate of `femtune modes`, `info` and `run` is computed from one uniform refinement (see
[check the model](../guide/info.md)). Here it is compared with the true error, the difference from a mesh of the same
elements with 64 elements a side (32 with mid-side grid points; tubes, box beams and solids 12 to 32), for 2 to 16
elements a half wave: the lowest mode with 2 grid intervals a side, three with 4, six with 8 and more. Modes are matched
with those of the reference mesh by their shapes. Half of the structures have lumped mass, the others consistent mass.

An estimate counts if it has the right sign and is between half and twice the true error. Where the errors of stiffness
and mass cancel, the true error can be any small number; the last column leaves errors below 0.1 % out."""


def report(found: list[Compared], lost: int) -> str:
    """The page."""
    lines = [_TEXT]
    lines += shares("structures", found, lambda c: c.case.family)
    lines += shares("elements", found, lambda c: c.case.cells)
    lines += shares("grid intervals a side", found, lambda c: str(c.sides * (2 if c.case.quadratic else 1)))
    lines += shares("mass", found, lambda c: "consistent" if c.case.coupled else "lumped")
    lines.append(f"\n{lost} modes resemble no mode of the reference mesh, and are not counted.")
    return "\n".join(lines)


def chosen(quick: bool) -> list[tuple[MeshedCase, tuple[int, ...], int]]:
    """Cases with the meshes and the reference: lumped and consistent mass in turn; a few in the quick form."""
    every = cases()
    half = len(every) // 2
    mixed = [every[i if i % 2 else half + i] for i in range(half)]
    if not quick:
        return [(c, c.sides, c.reference) for c in mixed]
    few = [c for c in mixed if c.name in ("plate, cantilever", "curved panel, clamped", "frame", "solid plate")]
    return [(c, tuple(n for n in c.sides if n <= 8)[-2:], min(c.reference, 24)) for c in few if c.cells in
            ("quad", "union", "quad8", "bar", "hexa8", "tetra10")]  # fmt: skip


def main() -> None:
    """All cases; the page is written by the full form."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few structures, with coarser references")
    parser.add_argument("--evidence", type=Path, help="folder for the tables of the documentation")
    arguments = parser.parse_args()
    every: list[Compared] = []
    for case, sides, reference in chosen(arguments.quick):
        every += compare(case, sides, reference)
        print(f"{case.name}, {case.cells}", file=sys.stderr, flush=True)
    found = [c for c in every if np.isfinite(c.true)]
    text = report(found, len(every) - len(found))
    if not arguments.quick:
        text += "\n\n## Estimates outside the factor of two\n" + "\n".join(worst(found))
        text += "\n\n## Processor time\n" + "\n".join(costs())
    print(text)
    if arguments.evidence:
        (arguments.evidence / "16_mesh_error.md").write_text(text + "\n")
    share = float(np.mean([c.good for c in found]))
    assert share >= SHARE, f"{100 * share:.1f} % of the estimates are within a factor of two"


if __name__ == "__main__":
    main()
