"""Natural modes, their shapes and files."""
