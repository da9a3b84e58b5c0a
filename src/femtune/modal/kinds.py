"""Kinds of measured data, by their words in files and records."""

from __future__ import annotations

from typing import Literal

FrfKind = Literal["receptance", "mobility", "accelerance"]
"""Displacement, velocity or acceleration over force, in the order of the powers of iω."""

Quantity = Literal["displacement", "velocity", "acceleration", "force", "strain", "pressure", "voltage", "unknown"]
"""What a channel has measured."""

Role = Literal["response", "reference", "input"]
"""What a channel is for: a reference is a response that all set-ups have in common, an input the excitation."""
