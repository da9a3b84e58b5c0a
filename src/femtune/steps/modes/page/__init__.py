"""Sections of the report about modes and their shapes."""
