"""Solids with and without mid-side nodes."""
