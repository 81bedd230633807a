"""Give the reason for each refusal, and whether the refusal is permanent."""

from collections.abc import Mapping

STAYS = "will not change"
TO_COME = "not available yet"

REFUSALS: Mapping[str, str] = {
    "so there is no limit load": f"{STAYS}: such bodies have no limit load",
    "is not a projection onto a yield set": f"{STAYS}: the algorithm consists of this projection",
    "does not support friction": f"{STAYS}: with T-FETI contact is a simple bound without friction",
    "is a formula": (
        f"{STAYS}: stresses are linear in cells and balance only linear tractions. If a body"
        " carries linear tractions below and above the quadratic one, this does not prove that it"
        " carries the quadratic one"
    ),
    "no limit theorem holds": (
        f"{STAYS}; a path finds the load at which equilibrium is lost, and Drucker's bounds"
        " accompany it"
    ),
    "is associated": f"{STAYS}: real slip is not normal to the friction cone",
    "normals on curved": f"{TO_COME}: obstacles that consist of planes",
    "superposes the elastic stresses": (
        f"{STAYS}: superposition of elastic stresses is not valid for bodies in contact"
    ),
    "a rigid surface moves": f"{TO_COME}: prescribed motions that vary",
    "cells are curved": f"{STAYS}: bounds hold for the body that straight cells fill",
}
"""Words of a message, with the reason that the page gives."""


def remark(sentence: str) -> str:
    """Return the reason that the page gives for a refusal.

    Raises:
        KeyError: If no refusal, or more than one, has these words.
    """
    found = [of for words, of in REFUSALS.items() if words in sentence]
    if len(found) != 1:
        raise KeyError(f"{len(found)} kinds of refusals have these words: {sentence}")
    return found[0]
