"""Which runs there are, and each of them in its own process."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import way_calculix
from checks import DERIVATIVE, FREQUENCY, frequency_difference
from journal import Journal, Row, Run
from process import Limits, run_within
from workspace import Workspace, prepare

from cases import CASES, Case
from femtune.errors import FemtuneError
from femtune.model.distributed import launch
from femtune.model.solvers.factorise import available_solvers

QUICK = ((CASES["subframe"], 20_000), (CASES["bracket"], 5_000))
EVERYWHERE = ("femtune", "eigsh-pardiso")
PEERS = ("slepc", "eigsh-superlu-symmetric", "eigsh-superlu", "calculix")
ONCE = ("eigsh-superlu-symmetric", "eigsh-superlu", "calculix")
_CALCULIX_NEAR = 0.1
_WORKER = Path(__file__).with_name("worker.py")


@dataclass(frozen=True)
class Plan:
    """What is to be run.

    Parameters
    ----------
    sizes : each case with one size; peers but eigsh on PARDISO run at the sizes in `compared`
    repeats, size_repeats : runs at the sizes where all ways are compared, and at the others
    """

    folder: Path
    sizes: tuple[tuple[Case, int], ...]
    compared: frozenset[tuple[str, int]]
    ways: tuple[str, ...]
    repeats: int
    size_repeats: int
    threads: int
    limits: Limits

    @property
    def journal(self) -> Journal:
        """Where rows go."""
        return Journal(self.folder / "journal.jsonl")

    def runs(self, case: Case, size: int) -> Iterator[Run]:
        """All ways, then all of them again: what the machine does beside is then shared evenly."""
        compared = (case.name, size) in self.compared
        for repeat in range(self.repeats if compared else self.size_repeats):
            for way in self.ways:
                if (way in EVERYWHERE or compared) and (repeat == 0 or way not in ONCE) and serves(case, way):
                    yield Run(case.name, size, way, repeat)

    def measure(self) -> Iterator[Row]:
        """Run what was not yet run; rows as they come."""
        for case, size in self.sizes:
            folder = self.folder / f"{case.name}_{size}"
            for run in self.runs(case, size):
                if self.journal.done(run):
                    continue
                if not Workspace(folder).is_ready:
                    prepare(case, size, folder)
                yield self._measured(run, folder)
            shutil.rmtree(folder, ignore_errors=True)

    def _measured(self, run: Run, folder: Path) -> Row:
        reference = self.journal.reference(run.case, run.size)
        if reference is None and run.way != "femtune":
            return {**vars(run), "status": "failed", "why": "femtune has no modes to compare with"}
        load = os.getloadavg()[0]
        result, log = folder / "result.json", folder / "log.txt"
        result.unlink(missing_ok=True)
        shift = "-" if reference is None else repr(reference["shift"])
        command = [sys.executable, str(_WORKER), run.way, str(folder), shift, str(result)]
        ended = run_within(command, environment(self.threads), log, self.limits)
        found = {"load": round(load, 2), "children_mib": ended.children_mib, **Workspace(folder).facts}
        if ended.over:
            return self.journal.add(run, {**found, "status": "limit", "why": ended.over})
        if ended.code or not result.exists():
            said = log.read_text(errors="replace").strip().splitlines()
            return self.journal.add(run, {**found, "status": "failed", "why": said[-1] if said else "no message"})
        return self.journal.add(run, {**found, **judged(json.loads(result.read_text()), run, reference)})


def serves(case: Case, way: str) -> bool:
    """True where the way is here and knows the elements of the case."""
    if way == "calculix":
        return case.calculix and way_calculix.program() is not None
    if way == "eigsh-pardiso":
        return "PARDISO" in available_solvers()
    if way == "slepc":
        try:
            return bool(launch.slepc_python() and launch.launcher(launch.ranks()) is not None)
        except FemtuneError:
            return False
    return True


def judged(row: Row, run: Run, reference: Row | None) -> Row:
    """The row with the difference of its frequencies from femtune's, and whether it counts."""
    note = row.pop("wrong")
    # a residual that others leave larger is shown, not held against them
    why, row["note"] = ([note], "") if run.way == "femtune" else ([], note)
    if reference is not None:
        pairs = zip(row["freq_hz"], reference["freq_hz"])
        row["frequency_difference"] = max(frequency_difference(found, wanted) for found, wanted in pairs)
        near = _CALCULIX_NEAR if run.way == "calculix" else FREQUENCY
        if not row["frequency_difference"] <= near:
            why.append(f"frequencies differ by {row['frequency_difference']:.1e}")
    off = [row.get("derivative_error", {}).get(name, 0.0) for name in ("eigenvalues", "shapes")]
    if not max(off) <= DERIVATIVE:
        why.append(f"derivatives are off by {max(off):.1e}")
    text = "; ".join(part for part in why if part)
    return {**row, "status": "wrong" if text else "ok", "why": text}


def environment(threads: int) -> dict[str, str]:
    """Threads fixed: MKL takes fewer by itself where a machine is loaded."""
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "CCX_NPROC_EQUATION_SOLVER")
    fixed = dict.fromkeys(names, str(threads)) | {"MKL_DYNAMIC": "FALSE", "FEMTUNE_SLEPC_RANKS": str(threads)}
    return {**os.environ, **fixed}
