"""Plan of a test: sensors, exciters, frequency lines."""
