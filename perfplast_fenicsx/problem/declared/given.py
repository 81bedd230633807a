"""Declare a problem independently of its mesh."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from perfplast_fenicsx.contact.declared.contact import Contact, Tie
from perfplast_fenicsx.contact.declared.obstacles import Obstacle
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.problem.declared.initial import Initial
from perfplast_fenicsx.problem.declared.loads import Load
from perfplast_fenicsx.problem.declared.supports import RigidSurface, Support

if TYPE_CHECKING:
    from perfplast_fenicsx.mesh.tagged_mesh import TaggedMesh

First = TypeVar("First")
Second = TypeVar("Second")


@dataclass(frozen=True)
class Given:
    """The arguments of :class:`problem.Problem` except the mesh, as documented there.

    Supports and rigid surfaces are separate here, and so are contacts and ties.
    """

    materials: Mapping[str, Material]
    supports: Sequence[Support]
    loads: Sequence[Load]
    contacts: Sequence[Contact]
    obstacles: Sequence[Obstacle]
    degree: int
    initial: Sequence[Initial]
    ties: Sequence[Tie]
    rigid: Sequence[RigidSurface]

    def check(self, tagged_mesh: "TaggedMesh") -> None:
        """Refuse misplaced or duplicate declarations, loads that are functions, and empty surfaces.

        Collective.

        Args:
            tagged_mesh: The mesh.

        Raises:
            InputError: If a declaration is refused; the message names it.
        """
        for load in self.loads:
            numbers = load.value if isinstance(load.value, Sequence) else [load.value]
            if not isinstance(load.value, str) and any(map(callable, numbers)):
                raise InputError(
                    f"the value of the load on '{load.on}' is a function; give numbers, or "
                    "formulas in x, y and z as text, such as '10*x'."
                )
        used = [one.on for one in (*self.supports, *self.obstacles, *self.rigid)]
        used += [load.on for load in self.loads if not load.in_volume]
        for pairs in (self.contacts, self.ties):
            used += [name for pair in pairs for name in (pair.primary, pair.secondary)]
        names = [name for name in dict.fromkeys(used) if name in tagged_mesh.surfaces]
        counts = [len(tagged_mesh.facets(name)) for name in names]
        counts = tagged_mesh.mesh.comm.allreduce(np.array(counts, dtype=np.int64))
        for name, count in zip(names, counts, strict=True):
            if not count:
                raise InputError(
                    f"the surface '{name}' has the tag {tagged_mesh.surfaces[name]}, which no facet"
                    " of the mesh has; tag its facets, or name another surface."
                )
        self._check_pairs(tagged_mesh)
        for number, one in enumerate(self.obstacles):
            for other in self.obstacles[:number]:
                same = replace(one, on="", name="") == replace(other, on="", name="")
                if same and {*tagged_mesh.tags_of([one.on])} & {*tagged_mesh.tags_of([other.on])}:
                    raise InputError(
                        f"the obstacle on '{one.on}' is the same as the obstacle on '{other.on}', "
                        "and their surfaces share facets; remove one of them."
                    )

    def _check_pairs(self, tagged_mesh: "TaggedMesh") -> None:
        """Refuse contacts or ties whose two surfaces share facets, or that share facets pairwise.

        Two contacts or ties may not share facets on both surfaces. A surface may touch several
        other surfaces, with one contact for each.

        Raises:
            InputError: If a contact or tie is refused; the message names it.
        """
        before: list[tuple[str, tuple[str, str], list[set[int]]]] = []
        given = [("contact", [(one.primary, one.secondary) for one in self.contacts])]
        given.append(("tie", [(one.primary, one.secondary) for one in self.ties]))
        for kind, pairs in given:
            for number, names in enumerate(pairs, start=1):
                if not all(name in tagged_mesh.surfaces for name in names):
                    continue  # the code that uses the name refuses unknown names
                place = f"{kind} {number} ('{names[0]}', '{names[1]}')"
                tags = [set(tagged_mesh.tags_of([name])) for name in names]
                if names[0] != names[1] and tags[0] & tags[1]:
                    raise InputError(
                        f"{place}: the two surfaces share facets, and a facet cannot touch "
                        "itself; name surfaces without common facets."
                    )
                for other, others, theirs in before:
                    both = (tags[0] & theirs[0] and tags[1] & theirs[1]) or (
                        tags[0] & theirs[1] and tags[1] & theirs[0]
                    )
                    if both and {*names} != {*others}:
                        raise InputError(
                            f"{place} shares facets on both surfaces with {other}; list each facet "
                            "in one contact or tie only."
                        )
                    if both:
                        raise InputError(
                            f"{place} has the same surfaces as {other}; remove one of them."
                        )
                before.append((place, names, tags))

    @property
    def holding(self) -> list[Support | RigidSurface]:
        """Return the supports, and rigid surfaces with an at least partly prescribed motion."""
        known = (surface for surface in self.rigid if surface.held or not surface.free)
        return [*self.supports, *known]


def by_kind(
    argument: str, entries: Sequence[First | Second], first: type[First], second: type[Second]
) -> tuple[list[First], list[Second]]:
    """Return the entries of the first kind, and those of the second, both in the given order.

    Args:
        argument: Name of the argument of :class:`problem.Problem`, for messages.
        entries: The entries of the argument.
        first: The first kind.
        second: The second kind.

    Raises:
        InputError: If the entries are not a list, or if an entry has neither kind.
    """
    if not isinstance(entries, Iterable):
        raise InputError(
            f"{argument} is an object of type {type(entries).__name__}, not a list; write it in"
            " brackets."
        )
    entries = [*entries]
    for entry in entries:
        if not isinstance(entry, (first, second)):
            raise InputError(
                f"{argument} = [...] contains an object of type {type(entry).__name__}; list only "
                f"objects of type {first.__name__} or {second.__name__} there."
            )
    found = [entry for entry in entries if isinstance(entry, first)]
    return found, [entry for entry in entries if isinstance(entry, second)]
