"""Tractions that a contact can bear, for strict bounds: a yield set of zero thickness.

A surface bears the tractions r = (r_n, r_t) of

    r_n ≤ 0,   ‖r_t‖ ≤ c − μ r_n,

with the adhesion c (stress), Tresca's constant shear stress, and the coefficient of friction μ. If
slip followed the normal of that set, the jump w = v_b − v_a along the normal out of a would keep to
w_n ≥ μ‖w_t‖ and dissipate c‖w_t‖: the set is the sum of the cone ‖r_t‖ ≤ −μ r_n, whose support
function is 0 there and ∞ elsewhere, and the disc ‖r_t‖ ≤ c.

With μ = 0 slip does follow it, and both limit theorems hold. With Coulomb's friction, μ > 0, it
does not, and Drucker's two theorems do (J. Appl. Mech. 21 (1954), 71). True tractions are in the
set, so that its upper bound is one of whatever slips. And true friction dissipates (c + μp)‖w_t‖,
no less than any tractions of the set with μ = 0 do, so that the lower bound of c alone is one too.
Where a contact says that slip follows the normal, as of a joint that dilates, both theorems hold of
the whole set.
"""

from dataclasses import dataclass

from perfplast_fenicsx.contact.declared.contact import FrictionTerms
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class ContactStrength:
    """The set of one contact or obstacle.

    Attributes:
        adhesion: C (stress), at least 0.
        friction: μ, at least 0.
        associated: Whether slip follows the normal of the set.
        reduced: Whether a factor of safety divides both.
    """

    adhesion: float
    friction: float
    associated: bool = False
    reduced: bool = True

    @property
    def loose(self) -> bool:
        """Whether it slips and parts, and dissipates nothing by that."""
        return self.friction > 0 and self.adhesion == 0


def strength_of(terms: FrictionTerms) -> ContactStrength:
    """Return the strength of a contact or an obstacle."""
    numbers = (terms.tresca or 0.0, terms.coulomb or 0.0)
    return ContactStrength(*numbers, terms.associated, terms.reduced)


def any_loose(problem: Problem) -> bool:
    """Return whether any contact or obstacle slips and parts, and dissipates nothing by that."""
    return any(it.loose for it in strengths_of(problem))


def strengths_of(problem: Problem) -> list[ContactStrength]:
    """Return those of all contacts and obstacles."""
    return [strength_of(it) for it in (*problem.given.contacts, *problem.given.obstacles)]
