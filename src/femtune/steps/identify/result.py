"""The result of `identify`: modes, poles and linearity, for Python users."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.errors import FemtuneError
from femtune.steps.result import StepResult
from femtune.study.rows import Rows, rows_of

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.modal import FrfSet, ModeSet
    from femtune.steps.identify.identified import Found
    from femtune.steps.identify.record import Identification
    from femtune.study.record import Alert


@dataclass(frozen=True, eq=False, repr=False)
class IdentifyResult(StepResult):
    """The identified modes, the poles from which they were chosen, and the folder of their files.

    Parameters
    ----------
    folder : where the files are
    record : all results except the arrays, as in identified.json
    found : the modes with the poles of every order, the measured and the synthesised functions
    files : names of the files in the folder
    report : the page that was written, None without one
    """

    folder: Path
    record: Identification
    found: Found
    files: tuple[str, ...]
    report: Path | None = None

    @property
    def modes(self) -> ModeSet:
        """The identified modes, with shapes at the sensors and standard deviations."""
        return self.found.modes

    @property
    def frequencies(self) -> Rows:
        """One line a mode: frequency in Hz and damping ratio with standard deviations, phase collinearity."""
        columns = ("label", "freq_hz", "freq_sd_hz", "damping_ratio", "damping_sd", "phase_collinearity", "remark")
        return rows_of(self.record.modes, *columns)

    @property
    def clusters(self) -> Rows:
        """Clusters of stable poles, chosen or not, and why."""
        return rows_of(self.record.clusters, "freq_hz", "damping_ratio", "chosen", "reason")

    @property
    def linearity(self) -> Rows:
        """Changes of each mode over the levels of the force, in %, and the verdict; no rows with one level."""
        linearity = self.record.linearity
        return Rows.of(
            {
                "label": m.label,
                "frequency_percent": m.frequency.largest_percent,
                "frequency_per_doubling_percent": m.frequency.per_doubling_percent,
                "damping_percent": m.damping.largest_percent,
                "damping_per_doubling_percent": m.damping.per_doubling_percent,
                "linear": m.linear,
            }
            for m in (linearity.modes if linearity is not None else ())
        )

    @property
    def poles(self) -> Rows:
        """Every pole of every order and method; no rows for methods without orders."""
        table = self.found.table
        if table is None:
            return Rows()
        poles = zip(table.method, table.order, table.freq_hz, table.damping_ratio, self.found.stable_poles())
        return Rows.of(
            {"method": m, "order": int(o), "freq_hz": float(f), "damping_ratio": float(z), "stable": bool(s)}
            for m, o, f, z, s in poles
        )

    @property
    def measured(self) -> FrfSet | None:
        """The measured functions at the lines of the fit; None if the input is not known."""
        return self.found.measured

    @property
    def synthesised(self) -> FrfSet | None:
        """The functions of the identified modes at the same lines; None if the input is not known."""
        return self.found.synthesised

    @property
    def remarks(self) -> tuple[Notice, ...]:
        """What the command line prints beside the modes: each with `code`, `level` and `what`."""
        return self.found.notices

    @property
    def notices(self) -> tuple[Alert, ...]:
        """`remarks` as they are in identified.json: with `sentence` in place of `what`."""
        return self.record.alerts

    def _sentences(self) -> list[str]:
        modes = [f"{m.label}: {m.freq_hz:.5g} Hz" for m in self.record.modes]
        alerts = [f"{a.level}: {a.sentence}" for a in self.record.alerts]
        return [f"{len(modes)} modes at {len(self.record.dofs)} sensors, {self.folder}", *modes, *alerts]

    def _table(self) -> Rows:
        return self.frequencies


class NothingFound(FemtuneError):  # noqa: N818
    """No mode was chosen; `found` has the poles from which a person may choose, and what was measured."""

    def __init__(self, error: FemtuneError, found: Found) -> None:
        super().__init__(error.code, error.what, where=error.where, values=error.values, hint=error.hint)
        self.facts, self.notices, self.found = error.facts, error.notices, found
        self.result: IdentifyResult | None = None
