"""The step ``identify``: from a record or from functions to modes, files and a page."""

from femtune.study.identification.asked import asked_of
from femtune.study.identification.found import Found
from femtune.study.identification.run import IdentifiedFolder, identify

__all__ = ["Found", "IdentifiedFolder", "asked_of", "identify"]
