"""Words of the runs of an external solver, as a study has them."""

from __future__ import annotations

from typing import Literal

KeptFolders = Literal["none", "failed", "all"]
"""Folders of runs that are kept."""
