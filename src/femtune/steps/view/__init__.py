"""A moving mode in a window."""
