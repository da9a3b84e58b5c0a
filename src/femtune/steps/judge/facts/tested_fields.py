"""What is tested at the end of an update: fields of the deck, masses that it lacks, parameters at a bound, supports."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from femtune.judge.point_masses import PointMass, neighbourhoods, points_without_mass
from femtune.judge.regions import mesh_of
from femtune.judge.widened import WideningFactor
from femtune.model.response.mass import mass_response
from femtune.steps.init.proposed_parameters import FieldCandidate, ProposalKind, candidates, fields_of_kinds
from femtune.steps.judge.facts.tested_supports import TestedSupport
from femtune.steps.judge.record.missing import PARAMETER

if TYPE_CHECKING:
    from femtune.fem import Structure
    from femtune.judge.regions import Mesh
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

MOST_FACTORS = 120
"""Factors of the widened model: its coefficients carry second derivatives, whose number grows as the square of it."""
MOST_MASSES = 32
"""Neighbourhoods of grid points that are given a mass: the lowest ten or twenty modes tell no more places apart."""
LARGEST_SHARE = 0.05
"""Of the mass of the model: a sensor, a motor or a cable that a deck leaves out seldom weighs more."""
_DEPTH = 2
"""How often a set of elements is divided: into halves, or pieces, and their halves."""
_MOST_NAMED = 4
"""Grid points of a neighbourhood that are listed."""

_INERTIA = ProposalKind("mass: moment of inertia", 0.7, 1.4)
_ADDED_MASS = ProposalKind("property: non-structural mass", 0.5, 2.0)
_AREA = ProposalKind("property: area", 0.9, 1.1)
_FURTHER = {
    **{("CONM2", name): _INERTIA for name in ("I11", "I22", "I33")},
    **{(card, "NSM"): _ADDED_MASS for card in ("PSHELL", "PCOMP", "PCOMPG", "PBAR", "PBARL", "PBEAM", "PROD", "PTUBE")},
    **{(card, "A"): _AREA for card in ("PBAR", "PBEAM", "PBCOMP", "PBEND")},
}
"""Fields that a first study does not propose, with their usual ranges."""


@dataclass(frozen=True)
class TestedField:
    """A field for some of the elements that use it, as the sum of factors of the widened model.

    Parameters
    ----------
    place : what the elements are; "" for all
    factors : positions
    region : the keys of [[parameter]] that choose them
    """

    __test__ = False  # no test class

    scale: ClassVar[float] = 1.0
    points: ClassVar[tuple[int, ...]] = ()
    candidate: FieldCandidate
    elements: frozenset[int]
    place: str
    factors: tuple[int, ...] = ()
    region: str = ""

    @property
    def field(self) -> str:
        """The field of the deck."""
        return str(self.candidate.ref)

    @property
    def what(self) -> str:
        """What it is."""
        return self.candidate.kind.what

    @property
    def usual(self) -> tuple[float, float]:
        """Least and largest usual change, relative to the value."""
        return self.candidate.kind.lower - 1.0, self.candidate.kind.upper - 1.0

    @property
    def lines(self) -> str:
        """A [[parameter]] of the study."""
        c = self.candidate
        name = c.name if not self.place else f"{c.name}_part_{min(self.elements)}"
        lines = ["[[parameter]]", f'name = "{name}"', f'fields = ["{c.ref}"]', *([self.region] if self.region else [])]
        return "\n".join([*lines, f"lower = {c.kind.lower:g}", f"upper = {c.kind.upper:g}"])


@dataclass(frozen=True)
class TestedMass:
    """A mass that the deck does not have; its change is relative to the largest plausible mass.

    Parameters
    ----------
    centre : of the grid points
    nearest : the grid point nearest to it
    factors : position in the widened model
    largest : plausible mass in the unit of the study; `per_unit` of the deck
    number : of an element that the deck does not have
    """

    __test__ = False  # no test class

    mass: PointMass
    centre: tuple[float, float, float]
    nearest: int
    factors: tuple[int, ...]
    largest: float
    number: int

    scale: ClassVar[float] = 1.0
    field: ClassVar[str] = "mass"
    what: ClassVar[str] = "mass that the deck does not have"
    usual: ClassVar[tuple[float, float]] = (0.0, 1.0)
    elements: ClassVar[frozenset[int]] = frozenset()

    @property
    def points(self) -> tuple[int, ...]:
        """Its grid points."""
        return self.mass.points

    @property
    def place(self) -> str:
        """Its grid points and where they are."""
        points, near = self.mass.points, ", ".join(f"{v:.3g}" for v in self.centre)
        if len(points) == 1:
            return f"at grid point {points[0]}"
        some = ", ".join(map(str, points[:_MOST_NAMED])) if len(points) <= _MOST_NAMED else f"{len(points)} grid points"
        return f"near ({near}), grid points {some}" if len(points) <= _MOST_NAMED else f"near ({near}), {some}"

    @property
    def lines(self) -> str:
        """A card for the deck, and a [[parameter]] of the study."""
        name = f"mass_at_{self.nearest}"
        return "\n".join([
            "# a card for the deck, at the grid point that is nearest to the mass:",
            f"# CONM2,{self.number},{self.nearest},,{0.5 * self.mass.largest:.4E}",
            "[[parameter]]", f'name = "{name}"', f'fields = ["CONM2 {self.number} M"]', "lower = 0.0", "upper = 2.0",
        ])  # fmt: skip


def tested_fields(study: Study) -> tuple[list[TestedField], list[WideningFactor], int]:
    """The fields that can be parameters, those that are parameters among them, since the test itself tells what the
    parameters represent; the factors that they are sums of; and how many fields are left out.

    A field of a material is also tested for each property, a field of many elements for the parts of its mesh (see
    `femtune.judge.regions`), as deep as there are not too many parts.
    """
    built = study.built
    mesh, known = mesh_of(built.structure), [*candidates(built), *fields_of_kinds(built, _FURTHER)]
    # read from the cards of all elements
    owners = built.property_of_elements
    for depth in range(_DEPTH, -1, -1):
        sets = [list(_sets(built.structure, owners, mesh, c, depth)) for c in known]
        parts = [_atoms([s for s, _, _ in of_one]) for of_one in sets]
        if sum(map(len, parts)) <= MOST_FACTORS:
            break
    left_out = 0
    while sum(map(len, parts)) > MOST_FACTORS:
        left_out += 1
        known, sets, parts = known[:-1], sets[:-1], parts[:-1]
    fields, factors = list[TestedField](), list[WideningFactor]()
    for candidate, of_one, atoms in zip(known, sets, parts):
        first, kind = len(factors), candidate.kind
        names = (f"q{first + i}_" for i in range(len(atoms)))
        factors += [WideningFactor(n, candidate.ref, atom, kind.lower, kind.upper) for n, atom in zip(names, atoms)]
        for elements, place, region in of_one:
            members = tuple(first + i for i, atom in enumerate(atoms) if atom <= elements)
            fields.append(TestedField(candidate, elements, place, members, region))
    return fields, factors, left_out


Part = tuple[frozenset[int], str, str]
"""Elements, what they are, and the keys of a [[parameter]] that choose them."""


def _sets(
    structure: Structure, owners: Mapping[int, int], mesh: Mesh, candidate: FieldCandidate, depth: int
) -> Iterator[Part]:
    """The whole field first, then its elements by property (`owners`), and the parts of these."""
    whole = frozenset(int(n) for n in structure.users(structure.values.index(candidate.ref) or 0))
    yield whole, "", ""
    if len(whole) < 2:
        return
    by_property: dict[int, set[int]] = {}
    for element in whole:
        by_property.setdefault(owners.get(element, 0), set()).add(element)
    for number, members in sorted(by_property.items()):
        elements = frozenset(members)
        if elements != whole and number:
            yield elements, f"elements of property {number}", f"region = {{ properties = [{number}] }}"
        for part in mesh.divided(elements, depth):
            at = mesh.centres[[mesh.row[e] for e in part]].mean(axis=0)
            near = ", ".join(f"{v:.3g}" for v in at)
            count = f"{len(part)} elements" if len(part) > 1 else f"element {min(part)}"
            yield part, f"{count} around ({near})", f'elements = "{_listed(sorted(part))}"'


def _atoms(sets: Sequence[frozenset[int]]) -> list[frozenset[int]]:
    """The largest sets of elements of which all sets are unions."""
    signature: dict[int, list[int]] = {}
    for i, members in enumerate(sets):
        for element in members:
            signature.setdefault(element, []).append(i)
    atoms: dict[tuple[int, ...], set[int]] = {}
    for element, where in signature.items():
        atoms.setdefault(tuple(where), set()).add(element)
    return [frozenset(members) for _, members in sorted(atoms.items(), key=lambda item: min(item[1]))]


def _listed(numbers: Sequence[int]) -> str:
    """Numbers with THRU for runs.

    Examples
    --------
    >>> _listed([1, 2, 3, 7, 9, 10])
    '1 THRU 3, 7, 9 THRU 10'
    """
    breaks = np.flatnonzero(np.diff(numbers) != 1) + 1
    runs = np.split(np.asarray(numbers), breaks)
    return ", ".join(f"{r[0]} THRU {r[-1]}" if len(r) > 1 else f"{r[0]}" for r in runs)


def tested_masses(study: Study, result: UpdateResult, first: int) -> list[TestedMass]:
    """Masses at the grid points that carry none, a neighbourhood each.

    Parameters
    ----------
    first : position of the first one in the widened model
    """
    states = result.after.states
    structure = study.model.structure
    total = mass_response(states[0].case.on_full_model.configured.at(result.x)).properties.mass
    if not (np.isfinite(total) and total > 0.0 and structure.nodes.has_coordinates):
        return []
    rows = points_without_mass(structure, [state.case.on_full_model.configured for state in states])
    largest, number = LARGEST_SHARE * float(total), 1 + max(structure.element_kinds, default=0)
    out = []
    for k, group in enumerate(neighbourhoods(structure.nodes.xyz[rows], MOST_MASSES)):
        xyz, points = structure.nodes.xyz[rows[group]], structure.nodes.ids[rows[group]]
        centre = xyz.mean(axis=0)
        nearest = int(points[np.argmin(np.linalg.norm(xyz - centre, axis=1))])
        mass = PointMass(f"m{first + k}_", tuple(int(n) for n in points), largest / structure.mass_factor)
        x, y, z = map(float, centre)
        out.append(TestedMass(mass, (x, y, z), nearest, (first + k,), largest, number))
    return out


@dataclass(frozen=True)
class BoundedParameter:
    """A parameter that ended at a bound: what the residuals ask for may lie beyond it.

    `room` is the change from the nominal value to the bound, relative to the nominal one: as far again is plausible.
    """

    name: str
    room: float

    points: ClassVar[tuple[int, ...]] = ()
    what: ClassVar[str] = PARAMETER
    place: ClassVar[str] = ""
    lines: ClassVar[str] = ""
    elements: ClassVar[frozenset[int]] = frozenset()

    @property
    def field(self) -> str:
        """The parameter."""
        return f"{self.name} beyond its bound"

    @property
    def usual(self) -> tuple[float, float]:
        """As far again as the bound is away."""
        return -self.room, self.room


def bounded_parameters(result: UpdateResult) -> list[BoundedParameter]:
    """The parameters that the update moved to a bound."""
    names = [p.name for p in result.parameters.free]
    room = np.abs(result.x)
    return [
        BoundedParameter(n, float(room[i]) or 1.0)
        for i, n in enumerate(names) if n in result.at_bound and n in result.active
    ]  # fmt: skip


Tested = TestedField | TestedMass | TestedSupport | BoundedParameter


def name_of(tested: Tested) -> str:
    """What is tested, and where."""
    if isinstance(tested, TestedSupport):
        return f"{tested.field} {tested.place}"
    return f"{tested.field}, {tested.place}" if tested.place else tested.field
