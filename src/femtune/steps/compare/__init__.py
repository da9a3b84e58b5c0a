"""Modes of two models of one structure."""
