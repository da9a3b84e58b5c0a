"""The program that solves K φ = λ M φ on all ranks of MPI. It is run by path in a Python that has slepc4py.

It must not import femtune: that Python is another one, and may be old. The folder that it is given holds

- request.json: ``task`` ("modes" or "count"), ``ranks``, ``shift``, ``count``, ``tolerance``
- K_data.npy, K_indices.npy, K_indptr.npy: upper triangle by rows; M_….npy likewise, or M_data.npy alone where the
  pattern is that of K

and takes rows_<rank>.npy (first row, shapes of these rows) and result.json. A rank reads only its own rows.
"""

from __future__ import annotations

import glob
import json
import os
import sys
import traceback
from typing import Any

import numpy as np

MISSING = 64
"""Exit code if SLEPc is not installed."""
_DEBIAN = ("/usr/lib/petscdir/petsc*/*-real", "/usr/lib/slepcdir/slepc*/*-real")


def libraries() -> tuple[Any, Any]:
    """PETSc and SLEPc with real numbers; Debian keeps them where Python does not look without its -dev packages."""
    try:
        import slepc4py  # type: ignore[import-not-found]  # noqa: PLC0415
    except ImportError:
        for pattern in _DEBIAN:
            sys.path += [d + "/lib/python3/dist-packages" for d in sorted(glob.glob(pattern), reverse=True)]
        import slepc4py  # noqa: PLC0415
    slepc4py.init([])
    from petsc4py import PETSc  # type: ignore[import-not-found]  # noqa: PLC0415
    from slepc4py import SLEPc  # noqa: PLC0415

    if np.dtype(PETSc.ScalarType) != np.float64:
        raise ImportError("this PETSc computes with complex numbers; femtune needs one with real numbers")
    return PETSc, SLEPc


def rows_of(starts: Any, rank: int, ranks: int) -> tuple[int, int]:
    """First row of each rank's share and the end, with about the same number of entries in each."""
    cuts = np.searchsorted(starts, np.linspace(0, starts[-1], ranks + 1)[1:-1])
    ends = np.maximum.accumulate(np.concatenate([[0], cuts, [len(starts) - 1]]))
    return int(ends[rank]), int(ends[rank + 1])


def matrix(PETSc: Any, folder: str, name: str) -> Any:
    """The part of a symmetric matrix that belongs to this rank, from the upper triangle in files."""
    pattern = name if os.path.exists(os.path.join(folder, name + "_indptr.npy")) else "K"
    data, indices, starts = (
        np.load(os.path.join(folder, part + ".npy"), mmap_mode="r")
        for part in (name + "_data", pattern + "_indices", pattern + "_indptr")
    )
    comm = PETSc.COMM_WORLD
    first, end = rows_of(np.load(os.path.join(folder, "K_indptr.npy"), mmap_mode="r"), comm.rank, comm.size)
    part = slice(int(starts[first]), int(starts[end]))
    local = np.asarray(starts[first : end + 1] - starts[first], dtype=PETSc.IntType)
    columns = np.asarray(indices[part], dtype=PETSc.IntType)
    size = (end - first, len(starts) - 1)
    out = PETSc.Mat().createSBAIJ((size, size), 1, csr=(local, columns, np.asarray(data[part])), comm=comm)
    out.assemble()
    out.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return out


def modes(PETSc: Any, SLEPc: Any, K: Any, M: Any, request: dict[str, Any]) -> tuple[Any, list[float]]:
    """Krylov-Schur on (K - shift M)^-1 M with factors by MUMPS."""
    eps = SLEPc.EPS().create(PETSc.COMM_WORLD)
    eps.setOperators(K, M)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
    eps.setDimensions(request["count"])
    eps.setTolerances(request["tolerance"], 500)
    eps.setTarget(request["shift"])
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    st = eps.getST()
    st.setType(SLEPc.ST.Type.SINVERT)
    st.setMatStructure(PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    direct(PETSc, st.getKSP())
    eps.solve()
    count = min(eps.getConverged(), request["count"])
    return eps, [eps.getEigenvalue(i).real for i in range(count)]


def direct(PETSc: Any, ksp: Any, inertia: bool = False) -> None:
    """A direct solution by MUMPS; what the environment's PETSC_OPTIONS says comes first."""
    options = PETSc.Options()
    # per cent of room for delayed pivots; pivots are counted with the last front on one rank and null ones told apart
    settings = {"14": 50, "13": 1, "24": 1} if inertia else {"14": 50}
    prefix = ksp.getOptionsPrefix() or ""
    for number, value in settings.items():
        name = prefix + "mat_mumps_icntl_" + number
        if not options.hasName(name):
            options[name] = value
    ksp.setType("preonly")
    pc = ksp.getPC()
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps")
    ksp.setFromOptions()


def shapes(eps: Any, K: Any, M: Any, values: list[float]) -> tuple[int, Any, list[float]]:
    """The rows of the modes that this rank holds, and the errors of all modes.

    An error is the residual r = K x - lambda M x as energy in (K - shift M)^-1, relative to that of the mode.
    """
    v, w = K.createVecs()
    r = v.duplicate()
    first, end = v.getOwnershipRange()
    out, errors = np.empty((end - first, len(values))), []
    for i, value in enumerate(values):
        eps.getEigenvector(i, v)
        out[:, i] = v.getArray(readonly=True)
        K.mult(v, r)
        M.mult(v, w)
        r.axpy(-value, w)
        eps.getST().getKSP().solve(r, w)
        errors.append(float(np.sqrt(abs(r.dot(w) / (value - eps.getTarget())))))
    return first, out, errors


def negative(PETSc: Any, K: Any, M: Any, shift: float) -> int:
    """Number of negative eigenvalues of K - shift M, from MUMPS; -1 where it is singular."""
    K.axpy(-shift, M, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    ksp = PETSc.KSP().create(PETSc.COMM_WORLD)
    ksp.setOperators(K)
    direct(PETSc, ksp, inertia=True)
    ksp.setUp()
    below, null, _ = ksp.getPC().getFactorMatrix().getInertia()
    return -1 if null else int(below)


def solve(folder: str) -> None:
    """Do what the request asks for."""
    PETSc, SLEPc = libraries()
    comm = PETSc.COMM_WORLD
    with open(os.path.join(folder, "request.json"), encoding="utf-8") as file:
        request = json.load(file)
    if request["ranks"] not in (None, comm.size):
        raise RuntimeError(
            f"{comm.size} of {request['ranks']} processes found each other: the launcher is of another MPI"
        )
    K, M = matrix(PETSc, folder, "K"), matrix(PETSc, folder, "M")
    if request["task"] == "count":
        result: dict[str, Any] = {"below": negative(PETSc, K, M, request["shift"])}
    else:
        eps, values = modes(PETSc, SLEPc, K, M, request)
        first, part, errors = shapes(eps, K, M, values)
        np.save(os.path.join(folder, f"first_{comm.rank}.npy"), np.array(first))
        np.save(os.path.join(folder, f"rows_{comm.rank}.npy"), part)
        result = {"values": values, "errors": errors, "iterations": eps.getIterationNumber()}
    comm.barrier()
    if comm.rank == 0:
        with open(os.path.join(folder, "result.json"), "w", encoding="utf-8") as file:
            json.dump(dict(result, ranks=comm.size), file)


def versions() -> None:
    """What this Python has, as a line of JSON."""
    PETSc, SLEPc = libraries()
    number = ".".join(str(i) for i in SLEPc.Sys.getVersion())
    print(json.dumps({"slepc": number, "petsc": ".".join(str(i) for i in PETSc.Sys.getVersion())}))


def main(argument: str) -> None:
    """Solve in a folder, or tell the versions; a rank that fails ends without waiting for the others."""
    try:
        versions() if argument == "--versions" else solve(argument)
    except ImportError as missing:
        print(missing, file=sys.stderr, flush=True)
        os._exit(MISSING)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)


if __name__ == "__main__":
    main(sys.argv[1])
