"""Start of SLEPc's processes: which Python, which launcher, how many ranks, and the errors if they fail."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from femtune.errors import FemtuneError, did_you_mean
from femtune.model.distributed.processes import run_to_end, seconds

PYTHON = "FEMTUNE_SLEPC_PYTHON"
RANKS = "FEMTUNE_SLEPC_RANKS"
LAUNCHER = "FEMTUNE_SLEPC_LAUNCHER"
INSTALLATION = (
    "apt-get install python3-slepc4py openmpi-bin libopenblas0-pthread (Debian, Ubuntu), "
    f"or name a Python that has slepc4py in {PYTHON}"
)
_PROGRAM = Path(__file__).with_name("program.py")
_SYSTEM_PYTHONS = ("/usr/bin/python3", "/usr/local/bin/python3")
_PROBE_SECONDS = 120
"""Time in which a Python must have imported SLEPc, which is slow on file systems of clusters."""
_TAIL_LINES = 15
"""Lines at the end of the output of failed processes that a message shows."""
_RANKS_PER_CORE = 4
"""Processes per core at most without a launcher of the user's: more are a mistake, and slow the machine down."""
_OPTIONS = "PETSC_OPTIONS"


def slepc_python() -> str:
    """The first Python with slepc4py: the one that the environment names, else of the system or this one.

    Raises
    ------
    FemtuneError : ``slepc.not-installed``, telling what each said
    """
    named = os.environ.get(PYTHON, "").strip()
    said = {}
    for candidate in [named] if named else _pythons():
        has_slepc, text = probe(candidate)
        if has_slepc:
            return candidate
        said[candidate] = text
    raise FemtuneError("slepc.not-installed", values=said, hint=INSTALLATION)


def _pythons() -> list[str]:
    candidates = [*_SYSTEM_PYTHONS, shutil.which("python3") or "", sys.executable]
    return [path for path in dict.fromkeys(candidates) if path and os.path.exists(path)]


@lru_cache(maxsize=8)
def probe(python: str) -> tuple[bool, str]:
    """Whether a Python has slepc4py, and its version or what is wrong."""
    try:
        done = subprocess.run(
            [python, str(_PROGRAM), "--versions"],
            capture_output=True, text=True, errors="replace", timeout=_PROBE_SECONDS, env=environment(1),
            stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as failed:
        return False, str(failed)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return False, last if _is_python(python) else f'is no Python 3: it said "{last}"'
    try:
        return True, str(json.loads(done.stdout.strip().splitlines()[-1])["slepc"])
    except (ValueError, LookupError, TypeError):
        return False, "its answer is not that of the program" if _is_python(python) else "is no Python 3"


def _is_python(command: str) -> bool:
    try:
        done = subprocess.run(
            [command, "-c", "import sys; print('Python', sys.version_info[0])"],
            capture_output=True, timeout=_PROBE_SECONDS, env=environment(1), stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.stdout.split() == [b"Python", b"3"]


def ranks() -> int:
    """Number of processes: of the environment, else one a core; at most a few a core without a launcher of the user's.

    Raises
    ------
    FemtuneError : ``slepc.launcher`` for what is not a positive number, or for more than this machine bears
    """
    text = os.environ.get(RANKS, "").strip()
    if not text:
        return cores()
    number = int(text) if text.isascii() and text.isdigit() and len(text) < 10 else 0
    most = _RANKS_PER_CORE * cores()
    if 0 < number <= most or (number and os.environ.get(LAUNCHER, "").strip()):
        return number
    raise FemtuneError(
        "slepc.launcher",
        values={RANKS: text[:80]},
        ranks=RANKS,
        most=most,
        ranks_per_core=_RANKS_PER_CORE,
        launcher=LAUNCHER,
    )


def expected_ranks() -> int | None:
    """Number of processes that must find each other; None where a launcher of the user's decides."""
    return None if os.environ.get(LAUNCHER, "").strip() else ranks()


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def launcher(number: int) -> list[str]:
    """The command before the Python that starts it on all ranks.

    Raises
    ------
    FemtuneError : ``slepc.launcher``
    """
    text = os.environ.get(LAUNCHER, "").strip()
    if text:
        return _split(text)
    if number == 1:
        return []
    mpiexec = shutil.which("mpiexec") or shutil.which("mpirun")
    if mpiexec is None:
        raise FemtuneError("slepc.launcher/no-mpiexec", number=number, launcher=LAUNCHER, ranks=RANKS)
    return [mpiexec, "-n", str(number)]


def _split(text: str) -> list[str]:
    try:
        words = shlex.split(text)
    except ValueError as unbalanced:
        raise FemtuneError(
            "slepc.launcher/unbalanced", values={LAUNCHER: text}, launcher=LAUNCHER, reason=unbalanced
        ) from unbalanced
    if shutil.which(words[0]) is None:
        raise FemtuneError("slepc.launcher/not-on-path", values={LAUNCHER: text}, program=words[0])
    return words


def start() -> tuple[int, list[str]]:
    """Number of processes, and the command in front of the program that they run.

    Wrong settings are reported before what is not installed.

    Raises
    ------
    FemtuneError : ``slepc.not-installed``, ``slepc.launcher``
    """
    seconds()
    number = ranks()
    python = slepc_python()
    return number, [*launcher(number), python]


def environment(number: int) -> dict[str, str]:
    """This environment with threads shared among the ranks; what the user has set stays."""
    defaults = {
        "OMP_NUM_THREADS": str(max(1, cores() // number)),
        # the user may ask for more processes than cores; variables of OpenMPI 4 and 5
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "OMPI_MCA_mpi_yield_when_idle": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    }
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        defaults |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return {**_inherited(os.environ), **{k: v for k, v in defaults.items() if k not in os.environ}}


def _inherited(variables: Mapping[str, str]) -> dict[str, str]:
    """Without what belongs to the Python of femtune alone."""
    return {k: v for k, v in variables.items() if k not in {"PYTHONHOME", "__PYVENV_LAUNCHER__"}}


def run(folder: Path) -> None:
    """Run the program on all ranks in a folder and wait; the end of femtune ends all of them.

    Raises
    ------
    FemtuneError : ``slepc.not-installed``, ``slepc.launcher``, ``slepc.timeout``, ``slepc.failed`` with the end of
        what they said
    """
    number, begin = start()
    command = [*begin, str(_PROGRAM), str(folder)]
    code = run_to_end(command, environment(number), folder / "said.txt")
    if code:
        raise failed_run(command, code, folder / "said.txt")


def failed_run(command: list[str], code: int, said: Path) -> FemtuneError:
    """The error of a launcher that ended with a code, with what it printed last."""
    text = said.read_text(encoding="utf-8", errors="replace")
    # the launcher's own words, framed by lines of dashes, hide the cause
    lines = [line for line in text.partition("-" * 60)[0].splitlines() if line.strip()]
    options = petsc_options()
    return FemtuneError(
        "slepc.failed/petsc-options" if options else "slepc.failed",
        values={"command": shlex.join(command), **options},
        exit_code=code,
        output="".join(f"\n    {line}" for line in lines[-_TAIL_LINES:]),
    )


def petsc_options() -> dict[str, str]:
    """Options that the environment gives to PETSc, for a message; {} without any."""
    text = os.environ.get(_OPTIONS, "").strip()
    return {_OPTIONS: text[:200]} if text else {}


# ----------------------------------------------------------------------------------------------------
# Who solves the eigenproblem: femtune itself, or SLEPc over MPI.


EIGENSOLVER = "FEMTUNE_EIGENSOLVER"
_NAMES = ("own", "slepc")


def check_slepc() -> None:
    """Refuse an unknown eigen-solver, and SLEPc if it cannot be started.

    Raises
    ------
    FemtuneError : ``solver.unavailable``, ``slepc.not-installed``, ``slepc.launcher``
    """
    if slepc_is_chosen():
        start()


def slepc_is_chosen() -> bool:
    """True where the environment (or the option --eigensolver) names SLEPc.

    Raises
    ------
    FemtuneError : ``solver.unavailable`` for an unknown name
    """
    name = os.environ.get(EIGENSOLVER, "").strip().lower() or "own"
    if name not in _NAMES:
        raise FemtuneError(
            "solver.unavailable", values={"available": ", ".join(_NAMES)}, hint=did_you_mean(name, _NAMES), name=name
        )
    return name == "slepc"
