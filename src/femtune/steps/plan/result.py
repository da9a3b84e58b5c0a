"""The result of `plan`: the planned test, its sensors and exciters, for Python users."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.study.rows import Rows, rows_of

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.steps.plan.record import PlanResults
    from femtune.steps.results import Results
from femtune.steps.result import Arrays, ResultWithPage


@dataclass(frozen=True, eq=False, repr=False)
class PlanResult(ResultWithPage):
    """A planned test: sensors, and what they are worth for the target modes.

    `record` is that of results.json, ``plan``; `results` has it with the facts of the model, `arrays` the arrays by
    key, `files` the files that were written, `report` the page, None without one; `remarks` what a user should know.
    """

    page = "plan"
    record: PlanResults
    results: Results
    arrays: Arrays
    remarks: tuple[Notice, ...] = ()
    files: tuple[Path, ...] = ()
    report: Path | None = None

    @property
    def sensors(self) -> Rows:
        """Sensors: `name`, `kind`, `node`, `dofs` of the test, coordinates, and effective `independence`."""
        return Rows.of(
            {
                "name": s.name,
                "kind": s.kind,
                "node": s.node,
                "dofs": " ".join(s.dofs),
                "x": s.position[0],
                "y": s.position[1],
                "z": s.position[2],
                "independence": s.independence,
            }
            for s in self.record.sensors
        )

    @property
    def modes(self) -> Rows:
        """Target modes: `number`, `freq_hz`, largest AutoMAC at the sensors and at all candidates."""
        columns = ("number", "freq_hz", "rigid_body", "auto_mac", "alike_number", "auto_mac_candidates")
        return rows_of(self.record.modes, *columns)

    @property
    def exciters(self) -> Rows:
        """Exciters: `name`, `node`, `dof` of the test, and the `sensor` at the driving point."""
        return rows_of(self.record.exciters, "name", "node", "dof", "sensor")

    @property
    def excitation(self) -> Rows:
        """Target modes: the `exciter` that excites each most, its `level`, and the mode `indicator` of all."""
        return rows_of(self.record.excitation, "number", "exciter", "level", "indicator")

    @property
    def parameters(self) -> Rows:
        """Free parameters: standard deviation of the prior, and those that an update with this test would have."""
        columns = ("name", "unit", "nominal", "prior_sd", "expected_sd", "worst_sd", "data_sd", "frequencies_sd")
        return rows_of(self.record.parameters, *columns)

    @property
    def calibration_lines(self) -> NDArray[np.float64] | None:
        """(lines,) frequency lines for a calibration in Hz; None if there are none."""
        lines = self.record.frequency_lines
        return None if lines is None else self.arrays[lines.calibration_key]

    @property
    def chosen_lines(self) -> NDArray[np.float64] | None:
        """(lines,) those of them, in Hz, that determine the parameters best; None where all are compared."""
        functions = self.record.functions
        return None if functions is None or functions.lines_key is None else self.arrays[functions.lines_key]

    @property
    def identification_lines(self) -> NDArray[np.float64] | None:
        """(lines,) in Hz, from which the poles follow with the least variance; None where none are wanted."""
        lines = self.record.pole_lines
        return None if lines is None else self.arrays[lines.spacings[-1].lines_key]

    @property
    def auto_mac(self) -> NDArray[np.float64]:
        """(m, m) AutoMAC of the target modes at the sensors."""
        return self.arrays[self.record.auto_mac_key]

    def _sentences(self) -> list[str]:
        chosen, kinds = self.record.chosen, [s.kind for s in self.record.sensors]
        counts = [f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds)]
        condition = "infinite" if chosen.condition is None else f"{chosen.condition:.3g}"
        return [
            f"{self.record.configuration}: {', '.join(counts)} sensors for {len(self.record.modes)} target modes",
            f"largest AutoMAC {chosen.auto_mac:.3f}, condition number {condition}",
            *(f"{a.level}: {a.sentence}" for a in self.record.alerts),
            *map(str, self.remarks),
        ]

    def _table(self) -> Rows:
        return self.sensors
