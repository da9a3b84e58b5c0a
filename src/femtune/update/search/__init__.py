"""How the length of a step is found, once the linear model gives its direction."""

from femtune.update.search.gauss_newton import GaussNewton
from femtune.update.search.levenberg_marquardt import LevenbergMarquardt
from femtune.update.search.line_search import LineSearch
from femtune.update.search.search import LocalModel, Search

__all__ = ["GaussNewton", "LevenbergMarquardt", "LineSearch", "LocalModel", "Search"]
