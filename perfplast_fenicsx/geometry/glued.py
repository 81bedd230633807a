"""Choose the joints that are glued in a first case."""

import re
from enum import Enum

from perfplast_fenicsx.geometry.survey import Joint

BOLT = re.compile(r"bolt|screw|stud|schraube|vis(_|$)|boulon|tornillo|vite(_|$)|sroub")
NUT = re.compile(r"(^|_)nut|mutter|ecrou|tuerca|dado|matice|matka")
"""Names of nuts in several languages."""


class Glued(Enum):
    """Joints that are glued in a first case."""

    SHARED = 0  # bodies that share faces in the drawing
    BOLTS = 1  # these as well
    ALL = 2
    NOTHING = 3

    def glues(self, joint: Joint) -> bool:
        """Return whether a joint becomes a tie instead of a contact."""
        bolted = self is Glued.BOLTS and is_bolt_with_nut(joint)
        return self is Glued.ALL or bolted or (joint.shared and self is not Glued.NOTHING)


def is_bolt_with_nut(joint: Joint) -> bool:
    """Return whether a bolt touches a nut, judged by the names of the bodies."""
    one, other = joint.bodies
    return any(BOLT.search(a) and NUT.search(b) for a, b in ((one, other), (other, one)))
