"""What a stress is worth as a proof, from the stress and the load alone."""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.static_program import StaticProgram

ROUNDING = 1e-9
"""What a certificate may leave, relative to the largest yield radius."""


@dataclass(frozen=True)
class StaticCertificate:
    """How far a stress is from being admissible.

    All but the last are relative to the largest yield radius γ, as in
    :func:`perfplast_fenicsx.proof.lower.measure_stress`: what is left has to be balanced by stress
    that plastic bodies have to bear beside this one. Mean stresses and those of elastic bodies are
    no measure of that, since nothing bounds them: beside a large one much could be left.

    Attributes:
        equilibrium: Largest div σ + λb, times the cell's size; in space also jumps of tractions
            between the parts of a cell.
        traction: Largest jump of tractions between cells, or traction that is not that of the load.
        shear: Largest tangential traction on surfaces in contact.
        tension: Largest pull on surfaces in contact.
        overstress: ‖dev σ‖/γ − 1 where that is largest; negative in bodies far from yield.
    """

    equilibrium: float
    traction: float
    shear: float
    tension: float
    overstress: float

    @property
    def holds(self) -> bool:
        """Whether the stress is admissible, but for rounding."""
        return all(value <= ROUNDING for value in vars(self).values())


def certify_stress(
    static: StaticProgram, pressure: Floats, deviator: Floats, load: float
) -> tuple[StaticCertificate, Floats]:
    """Judge a stress at the points of :class:`MultiplierStrains`. Collective.

    Args:
        static: The conditions.
        pressure: Mean stress, that in the plane in plane strain; shape (count,).
        deviator: Shape (count, m).
        load: λ.

    Returns:
        The certificate; the pressure on the vertices of facets that are hosts of contact, shape
        (num_hosts · d,).
    """
    strains, comm = static.strains, static.program.comm
    left = strains.create_vector()
    strains.forces(pressure, deviator, left)
    residual = left.array_r - load * static.load
    left.destroy()
    count, tdim = strains.facets.count, strains.gdim
    on_facets = residual[:count] / np.repeat(static.areas, tdim**2)
    inside = strains.inner(residual) / (static.volumes ** ((tdim - 1) / tdim))[:, None]
    others = ~(static.jumps | static.slips)
    sizes, radii = np.linalg.norm(deviator, axis=1), strains.radii
    largest: Floats = np.array(
        [
            np.abs(inside).max(initial=0),
            np.abs(on_facets[others]).max(initial=0),
            np.abs(on_facets[static.slips]).max(initial=0),
            on_facets[static.jumps].max(initial=0),
            radii[np.isfinite(radii)].max(initial=0),
            (sizes / radii - 1).max(initial=-1),
        ]
    )
    comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
    *parts, radius, over = largest
    in_cells, between, shear, tension = (float(part / radius) for part in parts)
    certificate = StaticCertificate(in_cells, between, shear, tension, float(over))
    return certificate, -on_facets[static.jumps]
