"""Check whether matched nodes can be in contact, and compute their normals and gaps."""

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.contact.declared.contact import Contact
from perfplast_fenicsx.contact.surfaces.node_matching import Matching
from perfplast_fenicsx.errors import InputError, raise_together
from perfplast_fenicsx.formulas import evaluate

MATCHING_TOLERANCE = 1e-6
"""Largest distance of touching nodes, relative to the size of the contact surfaces."""


OVERLAP = 1e-9
"""Overlap, relative to the size of the surfaces, that counts as rounding."""


class NoPartners(InputError):
    """Raised for surfaces whose nodes do not match; the same on every rank."""


def normals_and_gaps(
    comm: MPI.Intracomm,
    place: str,
    contact: Contact,
    matching: Matching,
    size: float,
) -> tuple[Floats, Floats]:
    """Return normal and gap of matched nodes, after checking that they can be in contact.

    Collective.

    Args:
        comm: The ranks.
        place: Place of the contact in the input, which messages name.
        contact: The contact, with its gap (a number or a formula, or None to measure it) and
            whether the gap may be negative.
        matching: Nodes of both surfaces, rows of :func:`surface_nodes.surface_node_type`.
        size: Size of the surfaces (length).

    Raises:
        NoPartners: For nodes without an opposite partner.
        InputError: For surfaces that do not face each other or that overlap, or for a negative gap.
    """
    if matching.alone:
        far = matching.farthest
        away = f" (the nearest is up to {far:.3g} away)" if 0 < far < np.inf else ""
        raise NoPartners(
            f"{place}: {matching.alone} nodes have no partner of their own on the other"
            f" surface{away}; choose formulation = 'mortar', or mesh the two"
            " surfaces with the same nodes, for instance by fragmenting and splitting in gmsh."
        )
    primary, secondary = matching.primary, matching.secondary
    facing = np.einsum("ni,ni->n", primary["normal"], secondary["normal"])
    same_side = comm.allreduce(int((facing > 0).sum()))
    if same_side:
        raise InputError(
            f"{place}: at {same_side} nodes the outward normals of the two surfaces point to the"
            " same side, so they do not face each other; name one surface of each body."
        )
    normal = primary["normal"] - secondary["normal"]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    between = (secondary["x"] - primary["x"])[:, : normal.shape[1]]
    apart = np.einsum("ni,ni->n", between, normal)
    sideways = np.linalg.norm(between - apart[:, None] * normal, axis=1)
    least = MATCHING_TOLERANCE * size
    mesh_size = np.minimum(primary["size"], secondary["size"])
    # Nodes that are apart may be shifted sideways by this share of their distance (and of the mesh
    # size). Matching surfaces that are not parallel show such a shift along their mean normal.
    tilt = 0.5
    allowed = least + tilt * np.minimum(np.abs(apart), mesh_size)
    shifted = comm.allreduce(int((sideways > allowed).sum()))
    if shifted:
        farthest = comm.allreduce(float(sideways.max(initial=0)), MPI.MAX)
        raise NoPartners(
            f"{place}: {shifted} nodes have no partner opposite them (the nearest is up to"
            f" {farthest:.3g} aside); choose formulation = 'mortar', or mesh the two surfaces with"
            " the same nodes, for instance by fragmenting and splitting in gmsh."
        )
    if contact.gap is not None:
        return normal, given_gap(comm, place, contact, primary["x"], size)
    if contact.interference:
        return normal, np.where(np.abs(apart) > OVERLAP * size, apart, 0.0)
    return normal, without_overlap(comm, place, apart, size)


def without_overlap(comm: MPI.Intracomm, place: str, gap: Floats, size: float) -> Floats:
    """Return measured gaps without rounding errors. Collective.

    Raises:
        InputError: If the bodies overlap.
    """
    overlap = -comm.allreduce(float(gap.min(initial=0)), MPI.MIN)
    if overlap > OVERLAP * size:
        raise InputError(
            f"{place}: the surfaces initially overlap by up to {overlap:.6g}, or face away "
            "from each other like two sides of one body; move one of them, name two that "
            "face each other, or give the contact interference = true if the overlap is "
            "intended."
        )
    return np.where(gap > OVERLAP * size, gap, 0.0)


def given_gap(comm: MPI.Intracomm, place: str, contact: Contact, x: Floats, size: float) -> Floats:
    """Return gaps from a number or formula at points, negative only for interference.

    Collective.
    """
    message: str | None = None
    gap = 0.0 if contact.gap is None else contact.gap
    gaps: Floats = np.zeros(len(x))
    try:
        gaps = evaluate(gap, x, f"{place}: gap")
        if not contact.interference and (gaps < -OVERLAP * size).any():
            message = (
                f"{place}: gap = {gap} is negative ({gaps.min():.6g}) at some nodes, but "
                "bodies cannot overlap initially; give a gap of zero or more, or "
                "interference = true if the overlap is intended."
            )
    except InputError as error:
        message = str(error)
    raise_together(comm, message)
    return gaps if contact.interference else np.maximum(gaps, 0.0)
