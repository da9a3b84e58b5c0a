"""Sections of the report: functions from the source to blocks; text/*.toml have their order and titles."""
