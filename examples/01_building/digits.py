"""Tables 7, 8 and 9 of the ten-parameter model, with the tolerances that the printed digits of the test justify.

The measured frequencies have three digits, so that each may be off by half of the last one: 0.15 % of 3.37 Hz, 0.4 % of
12.4 Hz. What this does to the updated model is computed from its Jacobian: the tolerance of a result is the largest
change that such errors of all measured values together can cause, and half of its own last digit.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import published as p
from make_inputs import TARGETS
from scipy.optimize import fsolve

from femtune.residuals import Evaluation
from femtune.residuals.pairing import modes_at_sensors
from femtune.steps.run.result import RunResult
from femtune.study.study import read_study

SHAPE_DIGIT, PERCENT_DIGIT, MAC_DIGIT = 0.0005, 0.005, 0.0005
"""Half of the last digit of an entry of a shape, of a frequency error in %, and of a MAC."""
MAC_TOLERANCE = 0.003
SHAPE_TOLERANCE = {"BC": 0.003, "NC": 0.015, "SC": 0.003}
"""Of an entry, beside what the digits explain: the masses of the steel are not published but recovered. In NC, whose
blocks are eccentric, they couple modes 2 and 3 and modes 5 and 6."""
STEP = 1e-4
"""Of parameters, for derivatives by differences."""
TABLE_9_TOLERANCE = 0.006
"""Relative: three digits of the parameters of M8, from which the table follows."""
NUMBERS = ("1", "2", "3", "4", "5", "6")


@dataclass(frozen=True, eq=False)
class Entry:
    """A mode of one configuration: ours, and the tolerances.

    `error` is the frequency error in %, NaN for mode 4, which is not compared with the test.
    """

    configuration: str
    mode: str
    hz: float
    hz_tolerance: float
    error: float
    error_tolerance: float
    shape: np.ndarray
    shape_tolerance: np.ndarray


def half_digit(value: float) -> float:
    """Half of the last of three digits."""
    return float(0.5 * 10.0 ** (np.floor(np.log10(value)) - 2))


def entries(path: Path, run: RunResult) -> list[Entry]:
    """The modes of the updated model."""
    study = read_study(path)
    problem, free = study.problem(), study.parameters.free
    x = np.array([run.values[q.name] / q.nominal - 1.0 for q in free])
    at = problem.start(x)
    J, digits, rows = at.jacobian, [], {}
    for block in at.blocks:
        if block.kind == "frequency":
            hz = measured(block.configuration)[block.mode]
            rows[block.configuration, block.mode] = len(digits)
            digits.append(half_digit(hz) / hz / 0.01)
        else:
            digits += [SHAPE_DIGIT / 0.1] * len(block.values)
    step = -np.linalg.solve(J.T @ J, J.T)
    of_error = np.abs(np.eye(len(J)) + J @ step) @ digits
    # frequencies and shapes, (3, 6, 7), and their derivatives by central differences
    here = modes_at(at)
    sides = [[modes_at(problem.start(x + side * d)) for side in (1.0, -1.0)] for d in STEP * np.eye(len(x))]
    slopes = np.array([(above - below) / (2.0 * STEP) for above, below in sides])
    spread = np.abs(np.einsum("kcmv,kn->cmvn", slopes, step)) @ digits
    found = []
    for c, name in enumerate(p.MODES_M8):
        for m, (mode, (hz, _)) in enumerate(zip(NUMBERS, p.MODES_M8[name])):
            row = rows.get((name, mode))
            compared = row is not None
            found.append(
                Entry(
                    name,
                    mode,
                    hz=float(here[c, m, 0]),
                    hz_tolerance=float(spread[c, m, 0]) + half_digit(hz),
                    error=float(at.residuals[row]) if compared else np.nan,
                    error_tolerance=float(of_error[row]) + PERCENT_DIGIT if compared else np.nan,
                    shape=here[c, m, 1:],
                    shape_tolerance=spread[c, m, 1:] + SHAPE_DIGIT + SHAPE_TOLERANCE[name],
                )
            )
    return found


def modes_at(at: Evaluation) -> np.ndarray:
    """(3, 6, 7) frequency in Hz and unit-norm shape of each mode, with the sign of the published one."""
    found = []
    for state in at.states:
        modes = modes_at_sensors(state.case, state.solution)
        shapes = modes.shapes / np.linalg.norm(modes.shapes, axis=0)
        wanted = np.array([shape for _, shape in p.MODES_M8[state.case.name]]).T
        found.append(np.vstack([modes.freq_hz[:6], shapes[:, :6] * np.sign(np.sum(shapes[:, :6] * wanted, axis=0))]).T)
    return np.array(found)


def measured(configuration: str) -> dict[str, float]:
    """Measured frequencies by mode."""
    return {label: hz for label, (hz, _) in zip(("1", "2", "3", "4a", "4b", "5", "6"), p.MEASURED[configuration])}


def check(found: list[Entry], run: RunResult) -> None:
    """Assert Tables 7 and 8."""
    for entry in found:
        hz, shape = p.MODES_M8[entry.configuration][NUMBERS.index(entry.mode)]
        assert abs(entry.hz - hz) <= entry.hz_tolerance, (entry, hz)
        assert (np.abs(entry.shape - shape) <= entry.shape_tolerance).all(), (entry, shape)
        if entry.mode in TARGETS:
            error, _ = p.RESIDUALS_M8[entry.configuration][TARGETS.index(entry.mode)]
            assert abs(entry.error - error) <= entry.error_tolerance, (entry, error)
    for correlation in run.results.correlations:
        if correlation.stage == "after":
            macs = {pair.test_label: pair.mac for pair in correlation.pairs}
            for mode, (_, mac) in zip(TARGETS, p.RESIDUALS_M8[correlation.configuration]):
                assert abs(macs[mode] - mac) <= MAC_TOLERANCE, (correlation.configuration, mode, macs[mode], mac)


def table_7(found: list[Entry]) -> list[str]:
    """Frequencies and the largest difference of an entry of a shape."""
    lines = [
        "| configuration | mode | f Hz | published | tolerance | largest difference of the shape | its tolerance |",
        "|---" * 7 + "|",
    ]
    for entry in found:
        hz, shape = p.MODES_M8[entry.configuration][NUMBERS.index(entry.mode)]
        off = np.abs(entry.shape - shape)
        worst = int(np.argmax(off / entry.shape_tolerance))
        lines.append(
            f"| {entry.configuration} | {entry.mode} | {entry.hz:.3f} | {hz:g} | {entry.hz_tolerance:.3f} "
            f"| {off[worst]:.3f} | {entry.shape_tolerance[worst]:.3f} |"
        )
    return lines


def table_8(found: list[Entry], run: RunResult) -> list[str]:
    """Frequency errors and MACs of M8 beside the published ones."""
    macs = {
        (c.configuration, pair.test_label): pair.mac
        for c in run.results.correlations if c.stage == "after" for pair in c.pairs
    }  # fmt: skip
    lines = ["| configuration | mode | Δf/f % | published | tolerance | MAC | published |", "|---" * 7 + "|"]
    for entry in found:
        if entry.mode in TARGETS:
            error, mac = p.RESIDUALS_M8[entry.configuration][TARGETS.index(entry.mode)]
            lines.append(
                f"| {entry.configuration} | {entry.mode} | {entry.error:.2f} | {error:.2f} "
                f"| {entry.error_tolerance:.2f} | {macs[entry.configuration, entry.mode]:.3f} | {mac:.3f} |"
            )
    return lines


def stiffness(c1: float, c2: float, b1: float, b2: float, length: float) -> np.ndarray:
    """(2, 2) of a planar frame with rigidities 2 E I of its columns and E I of its beams, rotations condensed."""
    h = p.STOREY
    uu = np.array([[12 * (c1 + c2), -12 * c2], [-12 * c2, 12 * c2]]) / h**3
    ut = np.array([[6 * (c2 - c1), 6 * c2], [-6 * c2, -6 * c2]]) / h**2
    tt = np.array([[4 * (c1 + c2) / h + 12 * b1 / length, 2 * c2 / h], [2 * c2 / h, 4 * c2 / h + 12 * b2 / length]])
    return np.asarray(uu - ut @ np.linalg.solve(tt, ut.T))


def equivalent(ratio: float) -> list[float]:
    """p1 … p8 with this ratio of upper to lower beams and the stiffness of the published M8."""
    by_direction = []
    for first, column, length in ((0, p.COLUMN_X, p.LENGTH_X), (1, p.COLUMN_Y, p.LENGTH_Y)):
        wanted = _of_direction(np.array(p.UPDATED["M8"][0])[[first, first + 2, first + 4, first + 6]], column, length)

        def off(
            log: np.ndarray, column: float = column, length: float = length, wanted: np.ndarray = wanted
        ) -> np.ndarray:
            c1, c2, b1 = np.exp(log)
            found = _of_direction(np.array([c1, c2, b1, ratio * b1]), column, length)
            return (found / wanted - 1.0)[np.triu_indices(2)]

        start = [p.RATIOS[ratio][first + i] for i in (0, 2, 4)]
        c1, c2, b1 = np.exp(fsolve(off, np.log(start), xtol=1e-12))
        by_direction.append((c1, c2, b1, ratio * b1))
    return [float(pair[k]) for k in range(4) for pair in by_direction]


def _of_direction(factors: np.ndarray, column: float, length: float) -> np.ndarray:
    E = p.YOUNG
    c1, c2, b1, b2 = factors * [2 * E * column, 2 * E * column, E * p.BEAM, E * p.BEAM]
    return stiffness(c1, c2, b1, b2, length)


def check_table_9() -> float:
    """Assert Table 9 from the published M8; returns the largest relative difference beyond half of the last digit."""
    worst = 0.0
    for ratio, row in p.RATIOS.items():
        for ours, printed in zip(equivalent(ratio), row):
            digit = 0.0005 if printed < 0.1 else half_digit(printed)
            beyond = max(abs(ours - printed) - digit, 0.0) / printed
            assert beyond <= TABLE_9_TOLERANCE, (ratio, ours, printed)
            worst = max(worst, beyond)
    return worst


def table_9() -> list[str]:
    """p1 … p8 that have the stiffness of the published M8, above the published ones."""
    lines = [f"| ratio | {' | '.join(name for name, *_ in p.PARAMETERS[:8])} |", "|---" * 9 + "|"]
    for ratio, row in p.RATIOS.items():
        lines.append(f"| **{ratio:g}** | " + " | ".join(f"{x:.3g}" for x in equivalent(ratio)) + " |")
        lines.append("| published | " + " | ".join(f"{x:g}" for x in row) + " |")
    return lines
