"""Files of a plan: geometry for the test system as a Universal File, and a table of the sensors."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError, Where
from femtune.files.uff import write_uff_geometry
from femtune.files.whole_file import write_whole
from femtune.steps.respond.run import check_places
from femtune.testdata import WireFrame

if TYPE_CHECKING:
    from collections.abc import Mapping

    from femtune.arrays import Reals
    from femtune.steps.plan.record import PlannedExciter, PlannedSensor, PlanResults
    from femtune.study.study import Study

_COLUMNS = ("name", "kind", "node", "dofs", "x", "y", "z", "direction_x", "direction_y", "direction_z", "independence")


@dataclass(frozen=True)
class PlanFiles:
    """Paths of the Universal File, of the table (CSV) and of the list of lines; None for a file that is not wanted."""

    uff: Path | None = None
    csv: Path | None = None
    lines: Path | None = None

    @property
    def written(self) -> tuple[Path, ...]:
        """The files that are wanted."""
        return tuple(path for path in (self.uff, self.csv, self.lines) if path is not None)


NO_FILES = PlanFiles()


def check_plan_files(study: Study, files: PlanFiles, page: Path | None) -> None:
    """Refuse, before anything is solved, what cannot be written.

    Raises
    ------
    FemtuneError : ``plan.pole-lines``, ``response.units-needed``, ``uff.cannot-write``, ``write.overwrites-input``
    """
    if files.lines is not None and (study.file.plan is None or study.file.plan.identification_lines is None):
        raise FemtuneError("plan.pole-lines/not-wanted", where=Where(str(files.lines)))
    if files.uff is not None and not study.units_known:
        raise FemtuneError("response.units-needed", where=Where(str(study.file.path)))
    wanted = [path for path in (page, *files.written) if path is not None]
    if wanted:
        check_places(study, wanted, files.uff)


def write_plan_files(study: Study, record: PlanResults, files: PlanFiles, arrays: Mapping[str, Reals]) -> None:
    """Write them (errors ``uff.cannot-write``, ``run.unwritable``)."""
    if files.uff is not None:
        write_uff_geometry(files.uff, sensor_frame(record), study.file.study.unit_system)
    if files.csv is not None:
        _write(files.csv, sensor_table(record))
    if files.lines is not None:
        of = record.pole_lines
        # a plan without them was refused before
        assert of is not None
        _write(files.lines, "".join(f"{hertz:.9g}\n" for hertz in arrays[of.spacings[-1].lines_key]))


def _write(path: Path, text: str) -> None:
    try:
        write_whole(path, text.encode())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FemtuneError("run.unwritable/table", where=Where(str(path)), reason=reason) from error


def sensor_frame(record: PlanResults) -> WireFrame:
    """Measured points with their local axes, and the trace lines."""
    points: dict[int, PlannedSensor | PlannedExciter] = {}
    everything: tuple[PlannedSensor | PlannedExciter, ...] = (*record.sensors, *record.exciters)
    for one in everything:
        points.setdefault(one.node, one)
    positions = [points[node] for node in sorted(points)]
    return WireFrame(
        np.array([s.node for s in positions], np.int64),
        np.array([s.position for s in positions]),
        np.array([s.axes for s in positions]),
        lines=record.lines,
    )


def sensor_table(record: PlanResults) -> str:
    """Sensors and exciters as CSV, one a line; a triaxial sensor has no direction but its three degrees of freedom."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for s in record.sensors:
        direction = ("", "", "") if s.direction is None else tuple(f"{v:.9g}" for v in s.direction)
        place = tuple(f"{v:.9g}" for v in s.position)
        writer.writerow((s.name, s.kind, s.node, " ".join(s.dofs), *place, *direction, f"{s.independence:.6g}"))
    for e in record.exciters:
        numbers = (f"{v:.9g}" for v in (*e.position, *e.direction))
        writer.writerow((e.name, "exciter", e.node, e.dof, *numbers, ""))
    return text.getvalue()
