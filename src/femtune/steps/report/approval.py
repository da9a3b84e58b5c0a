"""The document number and the lines for signatures, with the digests of what is signed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from femtune.document.document import Approval

if TYPE_CHECKING:
    from femtune.study.record import InputFile, ReportFacts

MOST_FILES = 8
"""Inputs whose digests are listed one by one; more are signed by the digest of their list."""


def document_facts(stated: ReportFacts) -> tuple[tuple[str, str], ...]:
    """Lines below the title: number, revision and persons, as far as they are stated."""
    lines = (
        ("Document", stated.document),
        ("Revision", stated.revision),
        ("Author", stated.author),
        ("Checked by", stated.checked_by),
        ("Approved by", stated.approved_by),
    )
    return tuple((name, text) for name, text in lines if text)


def approval_of(
    stated: ReportFacts, inputs: Sequence[InputFile], files: Iterable[InputFile], beside: str = ""
) -> Approval:
    """Roles with their names, and the digests of inputs and results; `files` are those that were written, `beside` is
    the file with the digest of the page."""
    roles = (("Prepared", stated.author), ("Checked", stated.checked_by), ("Approved", stated.approved_by))
    known = [one for one in inputs if one.sha256]
    written = [(one.path, one.sha256) for one in files]
    listed = list(dict.fromkeys((one.path, one.sha256) for one in known))
    if len(listed) > MOST_FILES:
        listed = [(f"list of {len(known)} inputs", list_digest(known))]
    note = f"The digest of this page is in {beside} beside it." if written and beside else ""
    if len(known) > MOST_FILES:
        note = f"The list has a line for each file of the section Provenance: digest, two spaces, name. {note}".strip()
    return Approval(roles, (*listed, *written), note)


def list_digest(files: Iterable[InputFile]) -> str:
    """SHA-256 of the lines ``digest  name`` of some files, as ``sha256sum`` writes them."""
    text = "".join(f"{one.sha256}  {one.path}\n" for one in files)
    return hashlib.sha256(text.encode()).hexdigest()
