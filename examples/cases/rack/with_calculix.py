"""The rack of solids at the values of the drawings, solved by CalculiX, beside the modal test."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from geometry import NOMINAL, sensors
from scipy.optimize import linear_sum_assignment
from solid import SolidMesh, input_text, mass

from femtune.files.modes.solved import SolvedModes
from femtune.modal import ModeSet
from femtune.modal.shape_criteria import mac
from femtune.runs import ExternalSolver, ResultFile, Templates, read_template
from femtune.validation import Verdict, judge
from femtune.validation.criteria import FREQUENCY, MAC, OWN, Criterion

MODES, ELASTIC_HZ = 16, 5.0


@dataclass(frozen=True, eq=False)
class SolidNominal:
    """Frequencies and MAC of the modes that belong to those of the test, the verdicts, nodes and mass in kg."""

    freq_hz: np.ndarray
    mac: np.ndarray
    verdicts: tuple[Verdict, Verdict]
    nodes: int
    mass: float


def solid_nominal(program: str, folder: Path, test: ModeSet, limits: tuple[float, float]) -> SolidNominal:
    """Solve the solid model, free, and judge it; `limits` are those of the frequency error and of MAC."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "free.inp").write_text(input_text(MODES))
    inputs = Templates((read_template(folder / "free.inp"),))
    result = ResultFile("free.frd", "calculix-frd")
    solver = ExternalSolver((program, "free"), inputs, result, folder / "runs", environment=(("OMP_NUM_THREADS", "1"),))
    found = solver.run(NOMINAL)
    if found.modes is None:
        raise SystemExit(f"CalculiX failed: {found.failures[-1]}")
    freq_hz, like = tracked(found.modes, test)
    errors = np.abs(freq_hz / test.freq_hz - 1.0)
    verdicts = (
        judge(Criterion(OWN, FREQUENCY, limits[0], True), float(errors.max()), f"mode {errors.argmax() + 1}"),
        judge(Criterion(OWN, MAC, limits[1], False), float(like.min()), f"mode {like.argmin() + 1}"),
    )
    return SolidNominal(freq_hz, like, verdicts, len(SolidMesh().nodes), mass(NOMINAL))


def tracked(modes: SolvedModes, test: ModeSet) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and MAC of the modes that belong to those of the test, by their shapes."""
    elastic = np.flatnonzero(np.nan_to_num(modes.freq_hz) > ELASTIC_HZ)
    rows = np.searchsorted(modes.nodes, list(sensors()))
    shapes = modes.shapes[rows][:, :3, elastic].reshape(-1, len(elastic))
    values = mac(test.shapes, shapes)
    of_test, of_model = linear_sum_assignment(-values)
    return modes.freq_hz[elastic[of_model]], values[of_test, of_model]
