"""Define the tractions that a contact can bear, for strict bounds: a yield set of zero thickness.

A surface bears the tractions r = (r_n, r_t) of

    r_n ≤ 0,   ‖r_t‖ ≤ c − μ r_n,

with the adhesion c (stress), Tresca's constant shear stress, and the coefficient of friction μ. Let
w = v_b − v_a be the jump, with w_n along the normal out of a. If slip followed the normal of that
set, w_n ≥ μ‖w_t‖ would hold, and the jump would dissipate c‖w_t‖. For the set is the sum of the
cone ‖r_t‖ ≤ −μ r_n, whose support function is 0 there and ∞ elsewhere, and the disc ‖r_t‖ ≤ c.

With μ = 0 slip follows the normal, and both limit theorems hold. With Coulomb's friction, μ > 0, it
does not, but Drucker's two theorems hold (J. Appl. Mech. 21 (1954), 71). True tractions are in the
set, so that its upper bound also holds for real slip. True friction dissipates (c + μp)‖w_t‖, no
less than tractions of the set with μ = 0 do. So the lower bound with c only also holds. If a
contact declares that slip follows the normal, as for a joint that dilates, both theorems hold for
the whole set.
"""

from dataclasses import dataclass

from perfplast_fenicsx.contact.declared.contact import FrictionTerms
from perfplast_fenicsx.problem.problem import Problem


@dataclass(frozen=True)
class ContactStrength:
    """The set of one contact or obstacle.

    Attributes:
        adhesion: Adhesion c ≥ 0 (stress).
        friction: Coefficient μ ≥ 0.
        associated: Whether slip follows the normal of the set.
        reduced: Whether a factor of safety divides both.
    """

    adhesion: float
    friction: float
    associated: bool = False
    reduced: bool = True

    @property
    def loose(self) -> bool:
        """Whether it can slip and separate without dissipation."""
        return self.friction > 0 and self.adhesion == 0


def strength_of(terms: FrictionTerms) -> ContactStrength:
    """Return the strength of a contact or an obstacle."""
    numbers = (terms.tresca or 0.0, terms.coulomb or 0.0)
    return ContactStrength(*numbers, terms.associated, terms.reduced)


def any_loose(problem: Problem) -> bool:
    """Return whether any contact or obstacle can slip and separate without dissipation."""
    return any(it.loose for it in strengths_of(problem))


def strengths_of(problem: Problem) -> list[ContactStrength]:
    """Return the strengths of all contacts and obstacles."""
    return [strength_of(it) for it in (*problem.given.contacts, *problem.given.obstacles)]
