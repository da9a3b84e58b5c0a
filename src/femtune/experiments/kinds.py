"""Words for samples of the unit cube, as a study names them."""

from __future__ import annotations

from typing import Literal

SampleWord = Literal["latin-hypercube", "nested-latin-hypercube", "sobol", "central-composite"]
"""Designs at whose points a surrogate is fitted."""
