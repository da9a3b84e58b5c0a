"""[output]: the run folder."""

from __future__ import annotations

from typing import Literal

from femtune.files.study_file.kinds import Text, TomlTable


class OutputTable(TomlTable):
    """[output]: the run folder; a relative path refers to the folder of the study file."""

    folder: Text = "run"
    """The run folder; created if it does not exist. Example: `"run"`"""


class StudyOutputTable(OutputTable):
    """[output] of a study: the run folder, and what is written beside the report."""

    vtu: bool = False
    """`femtune run` writes `shapes.vtu` for ParaView: mesh, modes and values of the parameters after the update; needs
    the extra `vtu`. Example: `true`"""
    live: bool | Literal["auto"] = "auto"
    """The report has a [live model](guide/report.md): its reader changes the parameters and sees frequencies and
    shapes. `"auto"`: where it takes a fraction of a second, or the update has reduced models; `true`: also where it
    takes about 16 more solutions of each configuration. Example: `true`"""
