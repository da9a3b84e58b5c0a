"""Pictures: each function returns a whole SVG file as text."""
