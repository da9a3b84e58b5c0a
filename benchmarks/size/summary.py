"""Medians of the rows that count, and the figures that are made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from journal import Row, is_good

BEFORE_MODES = ("read deck", "terms", "configure", "K and M")
MODES, CHANGED = "50 modes", ", changed"


@dataclass(frozen=True)
class Summary:
    """All runs of one way of a case at one size."""

    rows: tuple[Row, ...]

    @property
    def good(self) -> tuple[Row, ...]:
        """Those that count."""
        return tuple(row for row in self.rows if is_good(row))

    @property
    def way(self) -> str:
        """Its name."""
        return str(self.rows[0]["way"])

    @property
    def why(self) -> str:
        """Why the others do not count."""
        return "; ".join(dict.fromkeys(row["why"] for row in self.rows if not is_good(row)))

    @property
    def equations(self) -> int:
        """Free degrees of freedom."""
        row = self.rows[0]
        return int(row["equations"] if "equations" in row else row["size"])

    def seconds(self, *stages: str, what: str = "seconds") -> float | None:
        """Median of the sum of some stages (`what` may be cpu_seconds); None without a good run or such a stage."""
        sums = [_sum(row, stages, what) for row in self.good]
        found = [value for value in sums if value is not None]
        return median(found) if found else None

    def of_stage(self, stage: str, what: str) -> list[float]:
        """A number of a stage, of each good run."""
        return [row["stages"][stage][what] for row in self.good if what in row["stages"].get(stage, {})]

    def modes(self, suffix: str = "", what: str = "seconds") -> float | None:
        """From K and M to the modes: ordering (the first time), factorisations, iteration, and femtune's count."""
        stages = [MODES + suffix]
        if self.way == "eigsh-pardiso":
            stages += ["factorise" + suffix]
        if self.way == "eigsh-superlu-symmetric":
            stages += ["factorise"]
        if self.way in ("femtune", "eigsh-pardiso") and not suffix:
            stages += ["analyse"]
        return self.seconds(*stages, what=what)

    def total(self) -> float | None:
        """From the deck to the modes."""
        if self.way == "calculix":
            return self.seconds("50 modes, reading and assembly too")
        return self.seconds(*BEFORE_MODES, "analyse", MODES)

    def peak_gib(self) -> float | None:
        """Largest of the runs: of the process, and of its children where there are any."""
        found = [row["peak_mib"] + row["children_mib"] for row in self.good]
        return max(found) / 1024 if found else None

    def worst(self, what: str) -> float | None:
        """Largest of a check over points and runs."""
        found = [checks[what] for row in self.good for checks in row.get("checks", {}).values()]
        return max(found) if found else None

    def difference(self) -> float | None:
        """Of the frequencies from those of femtune's first run."""
        found = [row["frequency_difference"] for row in self.good if "frequency_difference" in row]
        return max(found) if found else None


def _sum(row: Row, stages: Sequence[str], what: str) -> float | None:
    measured = row["stages"]
    return sum(measured[name][what] for name in stages) if all(name in measured for name in stages) else None


def summaries(rows: Sequence[Row]) -> dict[tuple[str, int], dict[str, Summary]]:
    """By case and size, then by way."""
    grouped: dict[tuple[str, int], dict[str, list[Row]]] = {}
    for row in rows:
        grouped.setdefault((row["case"], row["size"]), {}).setdefault(row["way"], []).append(row)
    return {key: {way: Summary(tuple(found)) for way, found in ways.items()} for key, ways in sorted(grouped.items())}


def ratio(other: float | None, own: float | None) -> float | None:
    """How many times as long the other one takes."""
    return other / own if other is not None and own else None


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float | None:
    """Slope of log cost against log size; None for fewer than two sizes."""
    if len(set(sizes)) < 2:
        return None
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])
