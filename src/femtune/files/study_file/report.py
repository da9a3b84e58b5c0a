"""[report]: what the first page of the report states beside the results."""

from __future__ import annotations

from femtune.files.study_file.kinds import Text, TomlTable


class ReportTable(TomlTable):
    """[report]: document number, persons, and what only the author of the report knows about test and criteria."""

    document: Text | None = None
    """Number of the document. Example: `"TN-0451"`"""
    revision: Text | None = None
    """Revision of the document. Example: `"B"`"""
    author: Text | None = None
    """Who prepared the report. Example: `"A. Weber"`"""
    checked_by: Text | None = None
    """Who checks the report. Example: `"M. Rossi"`"""
    approved_by: Text | None = None
    """Who approves the report. Example: `"J. Novak"`"""
    standard: Text | None = None
    """Standard with its edition and section, as the project prescribes it; the limits themselves are those of
    [`[validate]`](#validate). Example: `"ECSS-E-ST-32-11C (31 July 2008)"`"""
    boundary: Text | None = None
    """How the structure was held in the test. Example: `"bolted to the seismic block, 8 × M12"`"""
    excitation: Text | None = None
    """How the structure was excited in the test. Example: `"impact hammer at 301X and 202Y"`"""
