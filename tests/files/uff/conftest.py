"""Fixtures of the UFF tests: the small case beside them becomes importable by name."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
