"""The solid model by its matrices, which CalculiX writes: many values of the moduli without a run of the solver each.

The stiffness matrix is a sum of the moduli times constant matrices, and the mass matrix of the densities. A run at the
values of the drawings and one more for each parameter give these matrices.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from geometry import NOMINAL
from laboratory import RIGID
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment, lsq_linear
from scipy.sparse.linalg import LinearOperator, eigsh
from solid import SolidMesh, input_text

from femtune.modal import ModeSet
from femtune.model.solvers.factorise import factorise
from femtune.model.vibration import ModesOnBase

MODULI = ("E1", "E2", "E3", "E4")
SHIFT_HZ = 20.0
"""Below the elastic modes; makes the matrix of the free rack regular."""
STEPS, SETTLED = 8, 1e-3
"""Most steps of an update, and the relative step at which it ends."""


@dataclass(frozen=True, eq=False)
class Fit:
    """An update by frequencies: moduli, χ² of the frequencies, MAC (m,) of all test modes, and derivatives.

    `relative` (n, 4) has the derivatives of the residuals with respect to the logarithms of the moduli.
    """

    values: dict[str, float]
    chi_square: float
    mac: np.ndarray
    residuals: np.ndarray
    relative: np.ndarray

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations of the moduli from the data (and prior knowledge) alone, without the bounds."""
        relative = np.sqrt(np.diag(np.linalg.inv(self.relative.T @ self.relative)))
        return {name: self.values[name] * float(sd) for name, sd in zip(MODULI, relative, strict=True)}


class Matrices:
    """Matrices of the free solid model: of each modulus, of the light parts and of the density of steel."""

    def __init__(self, program: str, folder: Path, divided: int) -> None:
        mesh = SolidMesh(divided)
        changed = {name: {**NOMINAL, name: 2.0 * NOMINAL[name]} for name in (*MODULI, "D2")}
        self.size = 0
        base_K, base_M = self._written(program, folder / "drawings", NOMINAL, divided)
        found = {name: self._written(program, folder / name, v, divided) for name, v in changed.items()}
        self.stiffness = {name: _thin((found[name][0] - base_K) / NOMINAL[name]) for name in MODULI}
        self.steel = _thin((found["D2"][1] - base_M) / NOMINAL["D2"])
        self.light = _thin(base_M - NOMINAL["D2"] * self.steel)
        self._solved: list[np.ndarray] = []
        names = [line.split(".") for line in (folder / "drawings" / "rack.dof").read_text().split()]
        self.row = {(int(node), int(axis)): i for i, (node, axis) in enumerate(names)}
        # C3D8I has further unknowns, of the incompatible modes, which do not move with the rack as a rigid body
        real, held = set(mesh.nodes.values()), {mesh.nodes[p] for p in mesh.nodes if mesh.on_table(p)}
        self.along_x = np.array([float(axis == "1" and int(node) in real) for node, axis in names])
        self.free = np.array([i for i, (node, _) in enumerate(names) if int(node) not in held])

    def _written(
        self, program: str, folder: Path, values: dict[str, float], divided: int
    ) -> tuple[sp.csr_array, sp.csr_array]:
        """Stiffness and mass matrix."""
        folder.mkdir(parents=True, exist_ok=True)
        text = input_text(1, values=values, divided=divided)
        text = text.replace("*FREQUENCY", "*FREQUENCY, SOLVER=MATRIXSTORAGE")
        path = folder / "rack.inp"
        if not (folder / "rack.mas").exists() or path.read_text() != text:
            path.write_text(text)
            environment = {**os.environ, "OMP_NUM_THREADS": "1"}
            subprocess.run([program, "rack"], cwd=folder, env=environment, check=True, capture_output=True)
        self.size = len((folder / "rack.dof").read_text().split())
        return self._read(folder / "rack.sti"), self._read(folder / "rack.mas")

    def _read(self, path: Path) -> sp.csr_array:
        rows, columns, entries = np.fromfile(path, sep=" ").reshape(-1, 3).T
        i, j = rows.astype(int) - 1, columns.astype(int) - 1
        off = i != j
        both = np.r_[i, j[off]], np.r_[j, i[off]]
        return sp.csr_array((np.r_[entries, entries[off]], both), shape=(self.size, self.size))

    def _at(self, values: dict[str, float]) -> tuple[sp.csr_array, sp.csr_array]:
        stiffness = sum(values[name] * self.stiffness[name] for name in MODULI)
        return sp.csr_array(stiffness), sp.csr_array(self.light + values["D2"] * self.steel)

    def on_table(self, values: dict[str, float], outputs: Sequence[str], modes: int) -> ModesOnBase:
        """Modes with the feet fixed, at outputs along X."""
        K, M = self._at(values)
        inner = np.ix_(self.free, self.free)
        eigenvalues, shapes = _modes(K[inner], M[inner], modes, 0.0)
        whole = np.zeros((self.size, modes))
        whole[self.free] = shapes
        self._solved.append(whole)
        seen = whole[self._rows(outputs)]
        return ModesOnBase(_hertz(eigenvalues), seen, whole.T @ (M @ self.along_x), np.ones(len(seen)))

    def reduced(self, outputs: Sequence[str], modes: int) -> Callable[[dict[str, float]], ModesOnBase]:
        """`on_table` at other moduli, by Ritz's method on all shapes that `on_table` found so far."""
        basis, _ = np.linalg.qr(np.hstack(self._solved))
        stiffness = {name: basis.T @ (self.stiffness[name] @ basis) for name in MODULI}
        steel, light = basis.T @ (self.steel @ basis), basis.T @ (self.light @ basis)
        pushed = {"D2": basis.T @ (self.steel @ self.along_x), "": basis.T @ (self.light @ self.along_x)}
        rows = basis[self._rows(outputs)]

        def at(values: dict[str, float]) -> ModesOnBase:
            K = sum(values[name] * stiffness[name] for name in MODULI)
            eigenvalues, q = eigh(K, light + values["D2"] * steel, subset_by_index=(0, modes - 1))
            participation = q.T @ (pushed[""] + values["D2"] * pushed["D2"])
            return ModesOnBase(_hertz(eigenvalues), rows @ q, participation, np.ones(len(rows)))

        return at

    def _rows(self, outputs: Sequence[str]) -> list[int]:
        return [self.row[int(name.removesuffix("X+")), 1] for name in outputs]

    def compared(self, values: dict[str, float], test: ModeSet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """By test mode: frequency of the free model, MAC, and derivatives (m, 4) of ln f by those of the moduli."""
        K, M = self._at(values)
        eigenvalues, shapes = _modes(K, M, RIGID + len(test.freq_hz) + 3, -((2.0 * np.pi * SHIFT_HZ) ** 2))
        eigenvalues, shapes = eigenvalues[RIGID:], shapes[:, RIGID:]
        rows = [self.row[dof.node, "XYZ".index(str(dof)[-2]) + 1] for dof in test.dofs]
        seen, tested = shapes[rows], np.real(test.shapes)
        mac = (tested.T @ seen) ** 2 / np.outer((tested**2).sum(axis=0), (seen**2).sum(axis=0))
        which = linear_sum_assignment(-mac)[1]
        slopes = [
            values[name] * np.einsum("nm,nm->m", shapes[:, which], self.stiffness[name] @ shapes[:, which])
            for name in MODULI
        ]
        of_frequency = np.array(slopes).T / (2.0 * eigenvalues[which])[:, None]
        return _hertz(eigenvalues[which]), mac[np.arange(len(which)), which], of_frequency

    def updated(
        self,
        start: dict[str, float],
        test: ModeSet,
        sd: float,
        used: int,
        bounds: dict[str, tuple[float, float]],
        known: dict[str, float],
    ) -> Fit:
        """Gauss-Newton on the frequencies; `known` has relative standard deviations of moduli about the drawings."""
        values = dict(start)
        limits = np.log([bounds[name] for name in MODULI]).T
        for _ in range(STEPS):
            x = np.log([values[name] for name in MODULI])
            hz, mac, slopes = self.compared(values, test)
            residuals = np.log(hz[:used] / test.freq_hz[:used]) / sd
            rows = [(np.array(MODULI) == name) / relative for name, relative in known.items()]
            prior = [np.log(values[name] / NOMINAL[name]) / relative for name, relative in known.items()]
            relative = np.vstack([slopes[:used] / sd, *rows])
            whole = np.r_[residuals, prior]
            step = lsq_linear(relative, -whole, (limits[0] - x - 1e-9, limits[1] - x + 1e-9)).x
            if np.abs(step).max() < SETTLED:
                break
            values |= dict(zip(MODULI, np.exp(x + step).tolist(), strict=True))
        else:
            raise RuntimeError(f"the moduli did not settle in {STEPS} steps")
        return Fit(values, float(residuals @ residuals), mac, whole, relative)


def _thin(matrix: sp.csr_array) -> sp.csr_array:
    """Without the zeros that differences leave."""
    matrix = sp.csr_array(matrix)
    matrix.eliminate_zeros()
    return matrix


def _hertz(eigenvalues: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(eigenvalues) / (2.0 * np.pi))


def _modes(K: sp.csr_array, M: sp.csr_array, count: int, shift: float) -> tuple[np.ndarray, np.ndarray]:
    """Lowest eigenvalues, and shapes of unit modal mass."""
    factor = factorise(sp.csr_array(K - shift * M))
    inverse = LinearOperator(K.shape, matvec=factor.solve, dtype=float)
    first = np.random.default_rng(0).standard_normal(K.shape[0])
    eigenvalues, shapes = eigsh(K, count, M, sigma=shift, OPinv=inverse, ncv=2 * count + 20, v0=first)
    order = np.argsort(eigenvalues)
    return np.maximum(eigenvalues[order], 0.0), shapes[:, order]
