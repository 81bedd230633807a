"""What of that which touches is glued in a first case."""

import re
from enum import Enum

from perfplast_fenicsx.geometry.survey import Joint

BOLT = re.compile(r"bolt|screw|stud|schraube|vis(_|$)|boulon|tornillo|vite(_|$)|sroub")
NUT = re.compile(r"(^|_)nut|mutter|ecrou|tuerca|dado|matice|matka")
"""How bolts and nuts are called in a few languages."""


class Glued(Enum):
    """What of that which touches is glued in a first case."""

    NOTHING = 0
    BOLTS = 1
    ALL = 2

    def glues(self, joint: Joint) -> bool:
        """Whether a joint becomes a tie, and no contact."""
        return self is Glued.ALL or (self is Glued.BOLTS and is_bolt_with_nut(joint))


def is_bolt_with_nut(joint: Joint) -> bool:
    """Whether a bolt touches a nut, by the names of the bodies."""
    one, other = joint.bodies
    return any(BOLT.search(a) and NUT.search(b) for a, b in ((one, other), (other, one)))
