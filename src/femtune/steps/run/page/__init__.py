"""Sections of the report about the whole run."""
