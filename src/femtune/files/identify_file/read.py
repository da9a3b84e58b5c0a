"""Read an identification file; all problems at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from femtune.errors import ErrorCollector, FemtuneError
from femtune.files.identify_file.tables import KNOWN_INPUT, OUTPUT_ONLY, IdentifyFile
from femtune.files.study_file.lines import line_numbers
from femtune.files.study_file.plain import table, texts
from femtune.files.study_file.problems import problems
from femtune.files.study_file.reading import toml_data, toml_text
from femtune.files.study_file.source import Source

PAGE = "docs/identify-file.md"


def read_identify_file(path: str | Path) -> IdentifyFile:
    """The identification file at `path`.

    Raises
    ------
    FemtuneError : ``study.missing-file``, ``study.syntax``
    FemtuneErrors : all that is wrong with its content: ``study.unknown-key``, ``study.type``, ``identify.source``,
        ``identify.output-only`` and others
    """
    file = Path(path)
    text = toml_text(file)
    data = toml_data(text, file)
    source = Source(str(file), line_numbers(text), PAGE)
    errors = [*_rules(data, source)]
    try:
        found = IdentifyFile.model_validate(data)
    except ValidationError as findings:
        errors = [*problems(findings, source, IdentifyFile), *errors]
    ErrorCollector(sorted(errors, key=lambda e: (e.where and e.where.line) or 0)).raise_if_any()
    found._path, found._source = file, source
    return found


def _rules(data: dict[str, Any], source: Source) -> Iterator[FemtuneError]:
    asked = table(data, "identify")
    if "identify" in data and ("record" in asked) == ("frfs" in asked):
        what = "[identify] names one of record (samples in time) and frfs (functions of frequency)"
        hint = 'write record = "ambient.csv" or frfs = "frf.unv"'
        yield source.error(("identify",), "identify.source", what, {}, hint)
    yield from _methods(asked, source)
    band = asked.get("band_hz")
    if (
        isinstance(band, tuple)
        and len(band) == 2
        and all(isinstance(b, int | float) for b in band)
        and band[0] >= band[1]
    ):
        hint = "give the lower end first: band_hz = [2.0, 40.0]"
        yield source.error(("identify", "band_hz"), "study.value", "the band is empty", {"band_hz": band}, hint)


def _methods(asked: dict[str, Any], source: Source) -> Iterator[FemtuneError]:
    """Methods must suit what was measured; with measured forces in a record those for FRFs do too."""
    known = KNOWN_INPUT if "frfs" in asked else (*KNOWN_INPUT, *OUTPUT_ONLY)
    for word in texts(asked.get("methods")):
        if word not in known and word in OUTPUT_ONLY:
            what = f"{word} works on records in time, and functions of frequency are named"
            hint = f"write one of {', '.join(known)}"
            yield source.error(("identify", "methods"), "identify.output-only", what, {"methods": word}, hint)
