"""A plane free frame with a cross bar as a deck and as dense matrices: plans for FRFs beside simulated tests.

Rectangle of 1.0 × 0.6 m with a cross bar at x = 0.5 m; steel bars of 20 × 12 mm that bend about the 12 mm side, Euler
beams with consistent mass. The parameters are the relative moduli of four groups: bottom, top, both sides, cross bar.
The dense matrices are assembled without femtune.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Complexes, Integers, Reals

GROUPS = ("bottom", "top", "sides", "cross")
BOUNDS = (0.7, 1.3)
_E, _RHO, _B, _H = 2.1e11, 7850.0, 0.020, 0.012
_MEMBERS = (
    (0, (0.0, 0.0), (1.0, 0.0), 8),
    (1, (0.0, 0.6), (1.0, 0.6), 8),
    (2, (0.0, 0.0), (0.0, 0.6), 6),
    (2, (1.0, 0.0), (1.0, 0.6), 6),
    (3, (0.5, 0.0), (0.5, 0.6), 6),
)


def _mesh() -> tuple[Reals, list[tuple[int, int, int]]]:
    """Points (n, 2), and group and ends of each element."""
    points: dict[tuple[float, float], int] = {}
    elements = []
    for group, start, end, count in _MEMBERS:
        along = np.linspace(start, end, count + 1).round(9)
        at = [points.setdefault((float(x), float(y)), len(points)) for x, y in along]
        elements += [(group, a, b) for a, b in pairwise(at)]
    return np.array(list(points)), elements


def frame_deck(folder: Path) -> Path:
    """Write ``frame.bdf``: grid points 1, 2 … move in the plane; group g has MAT1 g + 1."""
    points, elements = _mesh()
    area, inertia = _B * _H, _B * _H**3 / 12.0
    lines = ["SOL 103", "CEND", "METHOD = 1", "BEGIN BULK", "PARAM,COUPMASS,1", "EIGRL,1,,,30"]
    lines += [f"GRID,{i + 1},,{x},{y},0.,,345" for i, (x, y) in enumerate(points)]
    lines += [f"CBAR,{e + 1},{g + 1},{a + 1},{b + 1},0.,0.,1." for e, (g, a, b) in enumerate(elements)]
    for g in range(len(GROUPS)):
        # the third basic axis is in plane 1 of the bars, so that bending in the plane of the frame has I2
        lines += [f"PBAR,{g + 1},{g + 1},{area:.6e},{inertia:.6e},{inertia:.6e},{2 * inertia:.6e}"]
        lines += [f"MAT1,{g + 1},{_E:.3e},,0.3,{_RHO}"]
    path = folder / "frame.bdf"
    path.write_text("\n".join([*lines, "ENDDATA", ""]), encoding="ascii")
    return path


@dataclass(frozen=True, eq=False)
class DenseFrame:
    """K of each group (4, n, n) and M (n, n); DOFs x, y and rotation of each point."""

    K: Reals
    M: Reals

    @staticmethod
    def made() -> DenseFrame:
        """The frame of `frame_deck`."""
        points, elements = _mesh()
        n = 3 * len(points)
        K, M = np.zeros((len(GROUPS), n, n)), np.zeros((n, n))
        for group, a, b in elements:
            k, m = _beam(points[a], points[b])
            at = np.ix_(*[[*range(3 * a, 3 * a + 3), *range(3 * b, 3 * b + 3)]] * 2)
            K[group][at] += k
            M[at] += m
        return DenseFrame(K, M)

    def frfs(self, factors: Reals, outputs: Integers, inputs: Integers, freq_hz: Reals, ratio: float) -> Complexes:
        """(o, i, lines) accelerances between DOFs, all elastic modes with one damping ratio."""
        values, shapes = la.eigh(np.einsum("g,gij->ij", factors, self.K), self.M)
        omega, own = 2.0 * np.pi * freq_hz, np.sqrt(np.maximum(values, 0.0))[:, None]
        own[:3] = 0.0
        modal = -(omega**2) / (own**2 - omega**2 + 2j * ratio * own * omega)
        return np.asarray((shapes[outputs][:, None, :] * shapes[inputs][None]) @ modal)

    def calibrated(
        self, outputs: Integers, inputs: Integers, freq_hz: Reals, ratio: float, sd: float, tests: int, seed: int = 0
    ) -> Reals:
        """(tests, 4) factors found by Gauss-Newton from simulated FRFs at nominal values, in logarithms.

        Parameters
        ----------
        sd : standard deviation of real and imaginary parts relative to the magnitude
        """
        one = np.ones(len(GROUPS))
        exact = self.frfs(one, outputs, inputs, freq_hz, ratio)
        rng, found = np.random.default_rng(seed), []
        for _ in range(tests):
            noise = rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape)
            test, x = exact * (1.0 + sd * noise), one.copy()
            for _ in range(4):
                here = self.frfs(x, outputs, inputs, freq_hz, ratio)
                step = 1e-5 * np.eye(len(x))
                J = [np.log(self.frfs(x + e, outputs, inputs, freq_hz, ratio) / here).ravel() / 1e-5 for e in step]
                jacobian, off = np.array(J).T, np.log(here / test).ravel()
                pair = np.concatenate([jacobian.real, jacobian.imag]), np.concatenate([off.real, off.imag])
                x = x - np.linalg.lstsq(*pair)[0]
            found.append(x)
        return np.array(found)


def _beam(start: Reals, end: Reals) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness and consistent mass (6, 6) of an Euler beam in the plane."""
    length = float(np.linalg.norm(end - start))
    c, s = (end - start) / length
    EA, EI, m = _E * _B * _H / length, _E * _B * _H**3 / 12.0 / length**3, _RHO * _B * _H * length
    k, own = np.zeros((6, 6)), np.zeros((6, 6))
    k[np.ix_([0, 3], [0, 3])] = EA * np.array([[1, -1], [-1, 1]])
    own[np.ix_([0, 3], [0, 3])] = m / 6.0 * np.array([[2, 1], [1, 2]])
    L, at = length, np.ix_([1, 2, 4, 5], [1, 2, 4, 5])
    k[at] = EI * np.array(
        [[12, 6 * L, -12, 6 * L], [6 * L, 4 * L * L, -6 * L, 2 * L * L],
         [-12, -6 * L, 12, -6 * L], [6 * L, 2 * L * L, -6 * L, 4 * L * L]]
    )  # fmt: skip
    own[at] = m / 420.0 * np.array(
        [[156, 22 * L, 54, -13 * L], [22 * L, 4 * L * L, 13 * L, -3 * L * L],
         [54, 13 * L, 156, -22 * L], [-13 * L, -3 * L * L, -22 * L, 4 * L * L]]
    )  # fmt: skip
    turn = np.eye(6)
    for at3 in (0, 3):
        turn[at3 : at3 + 2, at3 : at3 + 2] = [[c, s], [-s, c]]
    return turn.T @ k @ turn, turn.T @ own @ turn
