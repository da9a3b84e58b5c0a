"""All mistakes of a study at once."""
