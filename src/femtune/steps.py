"""The words of the command line as functions: info, modes, correlate, select, update, report, run."""

from __future__ import annotations

from pathlib import Path

from femtune.study.steps import RunFolder, correlate, info, modes, select, update
from femtune.study.progress import Progress, silent

__all__ = ["RunFolder", "correlate", "info", "modes", "report", "run", "select", "update"]
