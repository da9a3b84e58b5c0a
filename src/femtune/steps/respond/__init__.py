"""Frequency responses, complex modes, static displacements."""
