"""Certify a stress as a proof, from the stress and the load alone."""

from dataclasses import dataclass

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import yield_ratios
from perfplast_fenicsx.limit_analysis.stress.static_program import StaticProgram

DOUBTED = 1e-10
"""Residuals, relative to strengths, of a bound that is doubted until the checker has judged it."""


@dataclass(frozen=True)
class StaticCertificate:
    """The distance of a stress from an admissible one.

    The first four numbers are stresses, relative to the least finite yield radius γ of the cells
    that each condition touches. Without cohesion −αp of the stress replaces γ if it is the least.
    Conditions in a cell touch the cell and those that share its facets; conditions on a facet touch
    the cells on both sides. For tension, and where all of these cells are elastic, it is the least
    γ of all cells. The proof checker decides how much these residuals cost.

    Attributes:
        equilibrium: Largest div σ + λb, times the cell's size; in space also jumps of tractions
            between the parts of a cell.
        traction: Largest jump of tractions between cells, or difference from the traction of the
            load.
        shear: Largest tangential traction on contact surfaces without friction.
        tension: Largest tensile traction on surfaces in contact.
        left_of_load: Sum of the magnitudes of all unbalanced forces, relative to the forces of the
            loads of each kind at λ.
        overstress: Largest relative excess of stresses over yield, negative in bodies far from
            yield. On surfaces with friction it is that of the shear traction over the strength.
    """

    equilibrium: float
    traction: float
    shear: float
    tension: float
    left_of_load: float
    overstress: float

    @property
    def is_doubted(self) -> bool:
        """Whether the checker may find that the residuals cost much."""
        return not self.is_balanced or self.overstress > DOUBTED

    @property
    def is_balanced(self) -> bool:
        """Whether the stress is in equilibrium, up to rounding."""
        return max(self.equilibrium, self.traction, self.shear, self.tension) <= DOUBTED


def certify_stress(
    static: StaticProgram, pressure: Floats, deviator: Floats, load: float, aside: float = 0.0
) -> StaticCertificate:
    """Measure the residuals of a stress at the points of :class:`MultiplierStrains`. Collective.

    Args:
        static: The conditions.
        pressure: Mean stress in the coordinates of the cones, shape (count,); zero at places of
            slip, which follow the points.
        deviator: Deviator in these coordinates, shape (count, m); shear tractions at places of
            slip.
        load: Load factor λ.
        aside: Factor of the loads of any factor.
    """
    strains, comm = static.form.strains, static.program.comm
    left = strains.create_vector()
    every = static.program.strains
    every.forces(pressure, deviator, left)
    residual = left.array_r - static.loads(load, aside)
    left.destroy()
    count, tdim = strains.facets.count, strains.gdim
    on_facets = residual[:count] / np.repeat(static.form.areas.ravel(), tdim)
    sections = static.form.sections
    inverse = strains.weaknesses(pressure)
    of_facets, of_cells = _weakness(static, inverse)
    inside = strains.inner(residual) / sections[:, None] * of_cells[:, None]
    between = np.abs(on_facets) * of_facets
    others = ~(static.form.jumps | static.form.slips)
    weakest = float(inverse.max(initial=0.0))
    largest: Floats = np.array(
        [
            np.abs(inside).max(initial=0),
            between[others].max(initial=0),
            between[static.form.slips].max(initial=0),
            on_facets[static.form.jumps].max(initial=0),
            (yield_ratios(every, pressure, deviator) - 1).max(initial=-1),
            weakest,
        ]
    )
    comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
    in_cells, jump, shear, pull, over, weakest = (float(value) for value in largest)
    forces = np.abs(residual)
    forces[:count][static.form.jumps] = np.maximum(residual[:count][static.form.jumps], 0.0)
    sums: Floats = np.array([forces.sum(), static.loaded(load, aside).sum()])
    comm.Allreduce(MPI.IN_PLACE, sums, MPI.SUM)
    missing, whole = (float(value) for value in sums)
    return StaticCertificate(
        equilibrium=in_cells,
        traction=jump,
        shear=shear,
        tension=pull * weakest,
        left_of_load=missing / whole if whole > 0 else float(missing > 0),
        overstress=over,
    )


def _weakness(static: StaticProgram, inverse: Floats) -> tuple[Floats, Floats]:
    """Return upper bounds of 1/γ of the weakest cell that each condition touches. Collective.

    Inverse radii are added up where cells meet. The sum exceeds the largest of them by a factor of
    at most 2, and of 4 at contact.

    Args:
        static: The conditions.
        inverse: Inverse radii 1/γ of the cells (:meth:`MultiplierStrains.weaknesses`).

    Returns:
        Values of the facets' unknowns that this rank owns, and of its cells.
    """
    facets = static.form.strains.facets
    everywhere = static.program.comm.allreduce(float(inverse.max(initial=0)), MPI.MAX)
    met = facets.meet(np.repeat(inverse[:, None], facets.of_cells.shape[1], axis=1))
    around = facets.gather(met).max(axis=1)
    of_facets, of_cells = (np.where(sums > 0, sums, everywhere) for sums in (met, around))
    return of_facets, of_cells
