"""A first study from a deck and a test: units, sensors, modes and parameters are guessed, and the reasons are told."""
