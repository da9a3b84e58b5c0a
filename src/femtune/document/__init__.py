"""Documents as data: blocks, numbers as text, figures."""
