"""Check whether the bodies of a drawing can be in contact as their first case declares."""

import tomllib
from pathlib import Path

from mpi4py import MPI

from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.rows.jump_basis import TooManyConditions
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.materials.elastic import Elastic
from perfplast_fenicsx.mesh.tagged_mesh import read_gmsh
from perfplast_fenicsx.problem.problem import Problem


def refused_contact(case: str, mesh: Path) -> str | None:
    """Return why ``perfplast run`` would refuse the contacts of a case; None if it accepts them.

    Not collective.

    Without this check, the user would see the refusal only after completing the case.

    Args:
        case: Text of the case; supports and loads may be missing.
        mesh: Mesh of the case.
    """
    pairs = tomllib.loads(case).get("contact", [])
    if not pairs:
        return None
    contacts = [Contact(**pair) for pair in pairs]
    bodies = read_gmsh(MPI.COMM_SELF, mesh)
    some = Elastic(young=1.0, poisson=0.3)  # the checks of contact are the same for any law
    try:
        Problem(bodies, dict.fromkeys(bodies.volumes, some), [], [], contacts, degree=2)
    except TooManyConditions as refusal:
        return f"perfplast run would refuse these contacts: {str(refusal).rstrip('.')}"
    except InputError:  # placeholders that the user is to replace
        return None
    return None
