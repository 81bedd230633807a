"""List the laws that a case file may name."""

from perfplast_fenicsx.materials.coulomb_ground import MohrCoulomb, Tresca
from perfplast_fenicsx.materials.drucker_prager import DruckerPrager
from perfplast_fenicsx.materials.elastic import Elastic, Rigid
from perfplast_fenicsx.materials.hardening import Hardening
from perfplast_fenicsx.materials.hill import Hill
from perfplast_fenicsx.materials.hoek_brown import HoekBrown
from perfplast_fenicsx.materials.law import Material
from perfplast_fenicsx.materials.von_mises import VonMises

MATERIALS: dict[str, type[Material]] = {
    "von-mises": VonMises,
    "von-mises-hardening": Hardening,
    "drucker-prager": DruckerPrager,
    "hill": Hill,
    "mohr-coulomb": MohrCoulomb,
    "tresca": Tresca,
    "hoek-brown": HoekBrown,
    "elastic": Elastic,
    "rigid": Rigid,
}
"""Material classes by the name of their law in case files."""
