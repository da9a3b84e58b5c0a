"""Specimens: nominally identical structures in one study, with common and individual parameters."""

from __future__ import annotations

from femtune.files.study_file.source import Data, Problems, StudyLines, tables, texts


def specimens_of(data: Data) -> list[str]:
    """Names of the specimens, in the order of the configurations."""
    names = (entry.get("specimen") for _, entry in tables(data, "configuration"))
    return list(dict.fromkeys(name for name in names if isinstance(name, str)))


def individual_name(parameter: str, specimen: str) -> str:
    """Name of a parameter of one specimen in the results."""
    return f"{parameter}_{specimen}"


def free_names(data: Data) -> list[str]:
    """Free parameters as other tables may name them: an individual one stands for those of all specimens."""
    specimens, out = specimens_of(data), []
    for _, entry in tables(data, "parameter"):
        name = entry.get("name")
        if isinstance(name, str) and "tie" not in entry:
            out.append(name)
            out += [individual_name(name, s) for s in specimens] if entry.get("individual") is True else []
    return out


def bounds_of(data: Data) -> dict[str, tuple[object, object]]:
    """Bounds of these parameters."""
    specimens, out = specimens_of(data), dict[str, tuple[object, object]]()
    for _, entry in tables(data, "parameter"):
        bounds, name = (entry.get("lower"), entry.get("upper")), str(entry.get("name"))
        out[name] = bounds
        if entry.get("individual") is True:
            out |= {individual_name(name, s): bounds for s in specimens}
    return out


def specimen_rules(data: Data, source: StudyLines) -> Problems:
    """Every configuration belongs to a specimen, or none does; individual parameters need specimens."""
    specimens = specimens_of(data)
    individual = [(place, e) for place, e in tables(data, "parameter") if e.get("individual") is True]
    for place, entry in individual:
        if "tie" in entry:
            yield source.error((*place, "individual"), "specimen.keys/tied", {}, parameter=entry.get("name", ""))
    if not specimens:
        for place, entry in individual:
            yield source.error((*place, "individual"), "specimen.keys/none", {}, parameter=entry.get("name", ""))
        return
    for place, entry in tables(data, "configuration"):
        if "specimen" not in entry:
            yield source.error(place, "specimen.keys", {}, configuration=entry.get("name", ""))
    if len(specimens) == 1:
        place = next(place for place, e in tables(data, "configuration") if "specimen" in e)
        yield source.error((*place, "specimen"), "specimen.keys/one", {}, specimen=specimens[0])
    yield from _names(data, specimens, source)
    for key in ("quantify", "plan"):
        if key in data:
            yield source.error((key,), "specimen.keys/other-table", {}, table=key)


def _names(data: Data, specimens: list[str], source: StudyLines) -> Problems:
    """The names that individual parameters get must differ from all others."""
    taken = {name for _, e in tables(data, "parameter") for name in texts((e.get("name"),))}
    for place, entry in tables(data, "parameter"):
        name = entry.get("name")
        if entry.get("individual") is True and isinstance(name, str):
            for specimen in specimens:
                made = individual_name(name, specimen)
                if made in taken:
                    yield source.error((*place, "name"), "specimen.keys/name-taken", {}, made=made, specimen=specimen)
