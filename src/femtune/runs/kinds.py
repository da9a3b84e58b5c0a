"""Words of the runs of an external solver, as a study has them."""

from __future__ import annotations

from pathlib import PurePosixPath, PureWindowsPath
from typing import Literal

from femtune.errors import FemtuneError

KeptFolders = Literal["none", "failed", "all"]
"""Folders of runs that are kept."""


def check_result_name(name: str) -> None:
    """Refuse the name of a result file that may lie outside the folder of its run (error ``external.result``)."""
    windows = PureWindowsPath(name)
    if windows.anchor or PurePosixPath(name).is_absolute() or ".." in windows.parts or not windows.name:
        raise FemtuneError("external.result", name=name)
