"""List interactions between two surfaces, by their names in case files."""

from perfplast_fenicsx.contact.declared.contact import Contact

INTERFACES: dict[str, type[Contact]] = {"friction": Contact}
"""Dataclasses whose fields are the keys of ``[[contact]]`` besides ``interface``.

Each is a :class:`~perfplast_fenicsx.contact.declared.contact.Contact`. It provides the strength of
the interface as ``tresca`` (stress) and ``coulomb``, which levels, limit loads, strict bounds,
proofs and reports read. A class with other parameters computes these two from its own numbers.
"""
