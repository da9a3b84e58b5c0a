"""Judgement of a fit: which part of the residuals is no noise, and what may be the reason."""
