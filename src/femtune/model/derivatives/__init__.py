"""Exact derivatives of modes with respect to the parameters."""
