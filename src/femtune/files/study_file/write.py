"""[write]: the updated deck."""

from __future__ import annotations

from femtune.files.study_file.kinds import TomlTable


class WriteTable(TomlTable):
    """[write]: options for writing the updated deck."""

    wide: bool = False
    """Changed cards are written in large-field format, with 16 characters per field. Example: `true`"""
    split: bool = True
    """If a field is shared with elements that are not updated, these keep the card, and the updated elements get a copy
    with a new number; the report lists the new cards. With `false` such a study is refused before the update.
    Example: `false`"""
    deck: bool = True
    """The update writes `updated.bdf`. With `false` no deck is written, as for parameters that no card can hold.
    Example: `false`"""
