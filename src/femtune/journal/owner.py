"""The study that a run folder belongs to, and the files that its runs made there.

``owner.json`` names the study by its path relative to the folder, so that a project that is moved as a whole keeps its
run folders. A folder of an earlier femtune has none; there results.json tells the study.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from femtune.errors import FemtuneError, Where
from femtune.files.whole_file import write_whole
from femtune.journal.run_files import OWNER_FILE, RESULTS_FILE

IN_MEMORY = "(in memory)"
"""In place of the path of a study of Python objects."""
_VERSION = 1
"""Version of the form of `OWNER_FILE`; files of other versions are not read."""
_MOST_BYTES = 1 << 22
"""Bytes of an `OWNER_FILE` that is read, 4 MiB: it has a line for each file of a run."""
_MOST_RESULTS = 1 << 28
"""Bytes of a results file that is read, 256 MiB: far more than that of a large study."""


@dataclass(frozen=True)
class Owner:
    """Whose a run folder is.

    Parameters
    ----------
    title : of the study
    path : of the study file; None for a study made of Python objects
    files : SHA-256 of the files that its runs made, by name; "" for one that a run has begun to make; None where that
        is not known, in a folder of an earlier femtune
    """

    title: str
    path: Path | None
    files: Mapping[str, str] | None = field(default_factory=dict)

    @property
    def shown(self) -> str:
        """The study in words."""
        return f'"{self.title}"' if self.path is None else f'{self.path.name} ("{self.title}")'

    def is_of(self, title: str, path: Path | None) -> bool:
        """Whether a study, given by its title and its file, is the owner: the same file, or one that was renamed.

        Studies of Python objects share a folder, since a script may change the title from run to run.
        """
        if self.path is None and path is None:
            return True
        if self.path is not None and self.path.is_file():
            return path is not None and os.path.samefile(self.path, path)
        return self.title == title

    def made(self, name: str) -> bool:
        """Whether a file of this name was made by its runs."""
        return self.files is None or name in self.files

    def has_unchanged(self, folder: Path, name: str) -> bool:
        """Whether a file is as its run left it."""
        known = (self.files or {}).get(name)
        return bool(known) and known == _digest(folder / name)


def owner_of(folder: Path, beside: Path) -> Owner | None:
    """The owner of a run folder; None for a folder without runs, or where nothing readable tells.

    Parameters
    ----------
    beside : folder of the study that asks; a folder of an earlier femtune tells the name of its study only
    """
    owner = _read(folder / OWNER_FILE, _MOST_BYTES)
    if owner.get("schema_version") == _VERSION and isinstance(owner.get("title"), str):
        study, files = owner.get("study"), owner.get("files")
        named = {str(k): str(v) for k, v in files.items()} if isinstance(files, dict) else {}
        return Owner(owner["title"], folder / study if isinstance(study, str) else None, named)
    owner = _read(folder / RESULTS_FILE, _MOST_RESULTS)
    study, origin = owner.get("study"), owner.get("provenance")
    if not isinstance(study, dict) or not isinstance(origin, dict):
        return None
    title, of_study = study.get("title"), origin.get("study_file")
    name = of_study.get("path") if isinstance(of_study, dict) else None
    if not isinstance(title, str) or not isinstance(name, str):
        return None
    return Owner(title, None if name == IN_MEMORY else beside / name, None)


def check_owner(folder: Path, title: str, path: Path | None, where: Where) -> Owner | None:
    """The owner of a run folder, which must be the study that asks, or nobody.

    Parameters
    ----------
    title, path : of the study; `path` is None for a study of Python objects
    where : what named the folder

    Raises
    ------
    FemtuneError : ``run.other-study``
    """
    owner = owner_of(folder, Path.cwd() if path is None else path.parent)
    if owner is not None and not owner.is_of(title, path):
        name = "run_" + (title if path is None else path.stem)
        raise FemtuneError("run.other-study", where=where, values={"folder": folder}, owner=owner.shown, other=name)
    return owner


def check_foreign(folder: Path, owner: Owner | None, names: Iterable[str]) -> None:
    """Refuse to replace files that the runs of the study did not make.

    Raises
    ------
    FemtuneError : ``run.other-file``
    """
    for name in names:
        if os.path.lexists(folder / name) and not (owner is not None and owner.made(name)):
            raise FemtuneError("run.other-file", where=Where(str(folder / name)), name=name)


def sign(folder: Path, title: str, path: Path | None, files: Mapping[str, str]) -> Owner:
    """Write down whose a folder is, and the files that its runs make (errors OSError)."""
    study = None if path is None else _relative(path, folder)
    content = {"schema_version": _VERSION, "title": title, "study": study, "files": dict(sorted(files.items()))}
    write_whole(folder / OWNER_FILE, json.dumps(content, indent=1).encode())
    return Owner(title, path, files)


def digests(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """SHA-256 by name of the files that are there."""
    digest_of = {name: _digest(folder / name) for name in names}
    return {name: known for name, known in digest_of.items() if known}


def _digest(path: Path) -> str:
    """ "" for what is no ordinary file."""
    try:
        if path.is_symlink() or not path.is_file():
            return ""
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:
        return ""


def _relative(path: Path, folder: Path) -> str:
    try:
        return os.path.relpath(os.path.realpath(path), os.path.realpath(folder)).replace("\\", "/")
    except ValueError:  # another drive
        return os.path.abspath(path)


def _read(path: Path, most: int) -> dict[str, Any]:
    """The object in a JSON file; empty where there is none."""
    try:
        if not path.is_file() or path.stat().st_size > most:
            return {}
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return data if isinstance(data, dict) else {}
