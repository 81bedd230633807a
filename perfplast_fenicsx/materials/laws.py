"""The laws that a case file may name."""

from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.materials.von_mises import VonMises

Material = Elastic | VonMises

MATERIALS: dict[str, type[Material]] = {"von-mises": VonMises, "elastic": Elastic}
