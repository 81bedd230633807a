"""Why a question has no answer: what a refusal is about, and whether it will stay."""

from collections.abc import Mapping

STAYS = "stays so"
TO_COME = "to come"

REFUSALS: Mapping[str, str] = {
    "so that bodies carry any load": f"{STAYS}: what hardens without end has no limit load",
    "is not a projection on a yield set": f"{STAYS}: the algorithm is made of that projection",
    "does not support friction": f"{STAYS}: contact is a bound there, and there is no friction",
    "is a formula": (
        f"{STAYS}: stresses are linear in cells, and balance linear tractions; what a body carries"
        " of linear ones below and above it need not carry of what lies between"
    ),
    "no limit theorem holds": (
        f"{STAYS} of limit theorems; where a path loses equilibrium is found, with Drucker's pair"
        " beside it"
    ),
    "is associated": f"{STAYS}: true slip follows no normal of friction's cone",
    "normals are averaged": f"{TO_COME}: obstacles that are made of planes",
    "adds up elastic stresses": (
        f"{STAYS}: elastic stresses of single loads are added up, which touching bodies forbid"
    ),
    "a rigid surface moves": f"{TO_COME}: given motions that vary",
    "cells are curved": f"{STAYS}: bounds are of the body that straight cells fill",
}
"""Words of the sentence, and what the page says of them."""


def remark(sentence: str) -> str:
    """Return the remark of the page on a refusal.

    Raises:
        KeyError: If no refusal, or more than one, has these words.
    """
    found = [of for words, of in REFUSALS.items() if words in sentence]
    if len(found) != 1:
        raise KeyError(f"{len(found)} kinds of refusals have these words: {sentence}")
    return found[0]
