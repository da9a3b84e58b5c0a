"""Renderers of documents: HTML and terminal."""
