"""What each solver can do, whether it is available here, and how it is installed."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass

import scipy

from femtune.errors import FemtuneError
from femtune.model.distributed import launch
from femtune.model.solvers import cholmod, mumps, pardiso, rslab
from femtune.model.solvers.factorise import INSTALLATION, available_solvers
from femtune.model.solvers.threads import threads


@dataclass(frozen=True)
class SolverFacts:
    """One solver.

    Parameters
    ----------
    purpose : "factorisation" or "eigenproblem"
    why_not : why it is not available; "" if it is
    version : "" if it is not available
    threads : threads, or processes, that it would take here
    inertia : it counts eigenvalues below a shift (Sturm)
    """

    name: str
    purpose: str
    at_hand: bool
    why_not: str
    version: str
    threads: int
    inertia: bool
    complex_numbers: bool
    distributed: bool
    licence: str
    installation: str


def solver_list() -> tuple[SolverFacts, ...]:
    """All solvers that femtune knows, the fastest first, then the one over MPI."""
    facts = (
        ("PARDISO", _pardiso, True, True, "Intel Simplified Software License (proprietary, redistributable)"),
        ("MUMPS", _python_mumps, True, True, "CeCILL-C; python-mumps BSD-2-Clause"),
        ("CHOLMOD", _scikit_sparse, False, False, "GPL-2.0-or-later (supernodal part); scikit-sparse BSD-2-Clause"),
        ("RSLAB", _rslab, True, True, "MIT"),
        ("SuperLU", _scipy, True, True, "BSD-3-Clause"),
    )
    return (*(_factorisation(*each) for each in facts), _slepc())


def _factorisation(
    name: str, look: Callable[[], tuple[str, str]], inertia: bool, numbers: bool, licence: str
) -> SolverFacts:
    why_not, version = look()
    at_hand = name in available_solvers()
    many = threads() if name != "SuperLU" else 1
    return SolverFacts(
        name=name,
        purpose="factorisation",
        at_hand=at_hand,
        why_not=why_not,
        version=version if at_hand else "",
        threads=many,
        inertia=inertia,
        complex_numbers=numbers,
        distributed=False,
        licence=licence,
        installation=INSTALLATION[name],
    )


def _pardiso() -> tuple[str, str]:
    version = _version("mkl")
    if pardiso.library() is not None:
        return "", version
    return "its library is installed but cannot be loaded" if version else "the package mkl is not installed", ""


def _python_mumps() -> tuple[str, str]:
    library = mumps.library()
    return (library, "") if isinstance(library, str) else ("", _version("python-mumps"))


def _scikit_sparse() -> tuple[str, str]:
    library = cholmod.library()
    return (library, "") if isinstance(library, str) else ("", _version("scikit-sparse"))


def _rslab() -> tuple[str, str]:
    library = rslab.library()
    return (library, "") if isinstance(library, str) else ("", _version("rslab"))


def _scipy() -> tuple[str, str]:
    return "", f"of SciPy {scipy.__version__}"


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _slepc() -> SolverFacts:
    why_not, version, processes = "", "", 1
    try:
        processes = launch.ranks()
        version = launch.probe(launch.start()[1][-1])[1]
    except FemtuneError as absent:
        why_not = absent.what
    return SolverFacts(
        name="SLEPc",
        purpose="eigenproblem",
        at_hand=not why_not,
        why_not=why_not,
        version=version,
        threads=processes,
        inertia=True,
        complex_numbers=False,
        distributed=True,
        licence="BSD-2-Clause (SLEPc, PETSc); factors by MUMPS, CeCILL-C",
        installation=launch.INSTALLATION,
    )


def solver_table(solvers: tuple[SolverFacts, ...]) -> str:
    """The list as text for a terminal."""
    return "\n\n".join(_paragraph(solver) for solver in solvers)


def _paragraph(facts: SolverFacts) -> str:
    state = f"available, version {facts.version}" if facts.at_hand else f"not available: {facts.why_not}"
    unit = "process" if facts.distributed else "thread"
    can = {
        "counts eigenvalues (inertia)": facts.inertia,
        "complex numbers": facts.complex_numbers,
        "several machines (MPI)": facts.distributed,
    }
    lines = {
        "for": facts.purpose,
        "takes": f"{facts.threads} {unit}{'' if facts.threads == 1 else 'es' if facts.distributed else 's'}",
        "can": ", ".join(name for name, able in can.items() if able) or "positive definite real matrices only",
        "licence": facts.licence,
        "to install": facts.installation,
    }
    return "\n".join([f"{facts.name}: {state}", *(f"  {name:<11}{text}" for name, text in lines.items())])
