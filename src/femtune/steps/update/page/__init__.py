"""Sections of the report about the update."""
