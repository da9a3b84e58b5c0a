"""The step ``identify``: from a record or from functions to modes, files and a page."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.study.identification.found import Found
    from femtune.study.identification.request import asked_of
    from femtune.study.identification.run import IdentifyResult, identify
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = ["Found", "IdentifyResult", "asked_of", "identify"]
