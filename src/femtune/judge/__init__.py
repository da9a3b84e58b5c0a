"""Judgement of a fit: what residuals and models show that a small misfit hides."""
