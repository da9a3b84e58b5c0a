"""Reader of the aeroplane's mesh: a text file of named blocks (coordinates, elements, groups)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class AeroplaneMesh:
    """Nodes (m), elements and groups by their numbers.

    `shells` and `links` are node numbers by element number, `groups` element or node numbers by number of the group.
    """

    nodes: dict[int, tuple[float, float, float]]
    shells: dict[int, tuple[int, ...]]
    links: dict[int, tuple[int, ...]]
    groups: dict[int, tuple[int, ...]]

    def thickness_group(self, shell: int) -> int:
        """The one of groups 1 to 8 that holds a shell."""
        return next(g for g in range(1, 9) if shell in self.groups[g])


def read_mesh(path: Path) -> AeroplaneMesh:
    """Read the mesh file."""
    nodes: dict[int, tuple[float, float, float]] = {}
    shells: dict[int, tuple[int, ...]] = {}
    links: dict[int, tuple[int, ...]] = {}
    groups: dict[int, tuple[int, ...]] = {}
    for kind, name, words in _blocks(path.read_text(encoding="latin-1")):
        if kind == "COOR_3D":
            rows = [words[i : i + 4] for i in range(0, len(words), 4)]
            nodes.update({_number(n): (float(x), float(y), float(z)) for n, x, y, z in rows})
        elif kind in ("QUAD4", "SEG2"):
            size = 5 if kind == "QUAD4" else 3
            rows = [[_number(w) for w in words[i : i + size]] for i in range(0, len(words), size)]
            (shells if kind == "QUAD4" else links).update({row[0]: tuple(row[1:]) for row in rows})
        elif kind.startswith("GROUP"):
            groups[int(name.removeprefix("GROUP"))] = tuple(map(_number, words))
    return AeroplaneMesh(nodes, shells, links, groups)


def _number(word: str) -> int:
    return int(word.lstrip("NM"))


def _blocks(text: str) -> Iterator[tuple[str, str, list[str]]]:
    """Kind, name and words of the data lines of each block; its head ends with the line of the format."""
    for block in text.split("FINSF"):
        lines = [line.strip() for line in block.splitlines() if line.strip() not in ("", "%")]
        start = next((i for i, line in enumerate(lines) if line.startswith("%FORMAT")), None)
        if start is not None:
            name = next(w for line in lines for w in line.split() if w.startswith("NOM="))
            yield lines[0].split()[0], name.removeprefix("NOM="), " ".join(lines[start + 1 :]).split()
