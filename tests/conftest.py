"""Fixtures that every part of the suite shares."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# a gate must say the same of the same code; HYPOTHESIS_PROFILE=default searches at random
settings.register_profile("repeatable", derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

_ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real measurements and decks; it lies beside the checkout and is no part of the project."""
    folder = Path(os.environ.get("FEMTUNE_SHARED_DATA", _ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the shared measurements are not here: {folder} (set FEMTUNE_SHARED_DATA)")
    return folder
