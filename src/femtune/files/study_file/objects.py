"""[[configuration]] as a Python object, whose test may be in memory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ConfigDict

from femtune.files.study_file.configuration import ConfigurationEntry
from femtune.files.study_file.python_table import PythonTable, unnamed_arguments
from femtune.testdata import ModalTest


class Configuration(ConfigurationEntry, PythonTable):
    """A configuration of the structure with its test: a [[configuration]] of a study, with its keys as keywords.

    `test` is a `ModalTest`, or the path of its file.

    Raises
    ------
    FemtuneError : ``study.*``, all errors together

    Examples
    --------
    >>> import femtune as ft
    >>> ft.Configuration("with mass", masses=[{"node": 12, "mass": 0.5}], use="validation").use
    'validation'
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    test: str | ModalTest | None = None  # type: ignore[assignment]

    if not TYPE_CHECKING:

        def __init__(self, name: str, *unnamed: Any, **words: Any) -> None:
            if unnamed:
                raise unnamed_arguments(type(self), ("name",), unnamed)
            super().__init__(name=name, **words)

    else:

        def __init__(self, name: str, *, test: str | Path | ModalTest | None = None, **words: Any) -> None: ...
