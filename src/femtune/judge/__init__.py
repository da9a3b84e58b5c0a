"""Judging of a fit: what a sceptical analyst would ask of the residuals, the parameters and the data of an update.

The functions take residuals and Jacobians at the end of an update and return frozen dataclasses; `femtune.steps.judge`
makes records of them and puts the verdict together.
"""
