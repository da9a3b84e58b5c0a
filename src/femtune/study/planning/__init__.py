"""The step plan: a test planned from the model."""
