"""Modes of a generated bar frame beside plain scipy: python benchmarks/eigen.py [--size SMALL LARGE] [--modes 20].

Times femtune's solve_modes (shift, modes, Sturm count) and scipy's eigsh(K, k, M, sigma) with its default SuperLU
in one run on the same matrices, and prints the ratio.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from femtune.fem import FieldRef, Structure
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    available_solvers,
    configure,
    parametric_model,
    solve_modes,
)
from femtune.parameters import Parameter, ParameterSet
from femtune.testing.structures import bars, make_structure

STEEL = {"E": 2.1e11, "G": 8.1e10, "A": 5e-3, "I1": 3e-5, "I2": 1e-5, "J": 1e-6, "rho": 7850.0}


def frame(size: int) -> Structure:
    """A clamped building frame of about `size` free DOFs, as high as it is wide."""
    n = max(2, round((size / 6.0) ** (1 / 3)))
    at = np.arange((n + 1) * n * n).reshape(n + 1, n, n)
    k, i, j = np.meshgrid(np.arange(n + 1), np.arange(n), np.arange(n), indexing="ij")
    xyz = np.column_stack([3.0 * i.ravel(), 4.0 * j.ravel(), 3.2 * k.ravel()])
    columns = np.column_stack([at[:-1].ravel(), at[1:].ravel()])
    along = np.column_stack([at[1:, :-1].ravel(), at[1:, 1:].ravel()])
    across = np.column_stack([at[1:, :, :-1].ravel(), at[1:, :, 1:].ravel()])
    parts = [
        bars(columns, STEEL, orientation=(1.0, 0.3, 0.0)),
        bars(np.vstack([along, across]), STEEL, orientation=(0.0, 0.0, 1.0)),
    ]
    return make_structure(xyz, parts, permanent=np.arange(6 * n * n), consistent_mass=True)


def model_of(structure: Structure) -> ConfiguredModel:
    """The frame with one parameter on the moduli of some columns."""
    chosen = [Assignment("E", FieldRef("CBAR", i, "E")) for i in range(1, 50)]
    return configure(parametric_model(structure, ParameterSet((Parameter("E"),)), chosen), Configuration())


def timed(what: str, act: Callable[[], object]) -> tuple[float, object]:
    """Seconds of a call, printed, and what it returned."""
    start = time.perf_counter()
    out = act()
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"  {what:42s} {seconds:8.2f} s   (peak memory so far {peak:.1f} GB)", flush=True)
    return seconds, out


def compare(size: int, modes: int) -> None:
    """Build, solve by both, and print the ratio."""
    structure = frame(size)
    _, model = timed("terms and configuration", lambda: model_of(structure))
    assert isinstance(model, ConfiguredModel)
    point = model.at(np.zeros(1))
    _, K = timed("K and M at a point", lambda: (point.mass, point.stiffness)[1])
    M = point.mass
    print(f"  {model.n_free} DOFs, {K.nnz} entries; solvers: {', '.join(available_solvers())}")
    ours, solution = timed("femtune, counted", lambda: solve_modes(point, modes))
    again, _ = timed("femtune, again (ordering known)", lambda: solve_modes(model.at(np.array([0.01])), modes))
    clean = [sp.csc_matrix(m) for m in (K, M)]
    theirs, values = timed(
        "scipy eigsh, SuperLU, not counted", lambda: spla.eigsh(clean[0], modes, clean[1], sigma=0.0)[0]
    )
    found = solution.eigenvalues[:modes]  # type: ignore[attr-defined]
    worst = np.abs(found / np.sort(values) - 1.0).max()  # type: ignore[call-overload]
    print(f"  scipy/femtune: {theirs / ours:.1f}, later points {theirs / again:.1f}; frequencies agree to {worst:.1e}")


def main() -> None:
    """Both sizes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, nargs="+", default=[20_000, 100_000], help="numbers of DOFs")
    parser.add_argument("--modes", type=int, default=20)
    arguments = parser.parse_args()
    for size in arguments.size:
        print(f"frame of about {size} DOFs, {arguments.modes} modes")
        compare(size, arguments.modes)


if __name__ == "__main__":
    main()
