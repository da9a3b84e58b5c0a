"""The whole run of a study."""
