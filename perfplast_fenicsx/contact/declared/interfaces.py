"""Interactions between two surfaces, by their names in case files."""

from perfplast_fenicsx.contact.declared.contact import Contact

INTERFACES: dict[str, type[Contact]] = {"friction": Contact}
"""Dataclasses whose fields are the keys of ``[[contact]]`` beside ``interface``.

Each is a :class:`~perfplast_fenicsx.contact.declared.contact.Contact`, which says the strength of
the interface as ``tresca`` (stress) and ``coulomb``: levels, limit loads, strict bounds, proofs and
reports read these. One of another kind makes them of its own numbers.
"""
