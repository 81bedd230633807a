"""Whether bodies of a drawing can be in contact as their first case says."""

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
    """Why the contacts of a case would be refused; None where they are not. On one rank.

    A user would hear of it otherwise when all is filled in.

    Args:
        case: Its text; supports and loads may be missing.
        mesh: Its mesh.
    """
    pairs = tomllib.loads(case).get("contact", [])
    if not pairs:
        return None
    contacts = [Contact(**pair) for pair in pairs]
    bodies = read_gmsh(MPI.COMM_SELF, mesh)
    some = Elastic(young=1.0, poisson=0.3)  # conditions are the same of any law
    try:
        Problem(bodies, dict.fromkeys(bodies.volumes, some), [], [], contacts, degree=2)
    except TooManyConditions as refusal:
        return f"perfplast run would refuse these contacts: {str(refusal).rstrip('.')}"
    except InputError:  # of what is to be filled in
        return None
    return None
