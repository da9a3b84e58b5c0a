"""Axes of arrays of frequency response functions."""

from __future__ import annotations

from typing import Literal, get_args

Axis = Literal["frequency", "response", "reference", "function", "part"]
AXES: tuple[str, ...] = get_args(Axis)
