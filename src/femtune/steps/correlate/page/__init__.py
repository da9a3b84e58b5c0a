"""Sections of the report that compare test and model."""
