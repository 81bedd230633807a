"""Certify a stress as a proof, from the stress and the load alone."""

from dataclasses import dataclass, replace

from mpi4py import MPI

import numpy as np
from dolfinx import fem

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import yield_ratios
from perfplast_fenicsx.limit_analysis.statements.bound import Bound, Scope
from perfplast_fenicsx.limit_analysis.stress.piece_balance import largest_left
from perfplast_fenicsx.limit_analysis.stress.static_program import StaticProgram

ROUNDING = 1e-10
"""Limit of a residual, relative to the least yield radius of the cells it touches. Mean stresses
are not bounded; they may be 1e5 times as large, and have their own rounding.
"""


@dataclass(frozen=True)
class StaticCertificate:
    """The distance of a stress from an admissible one.

    The first four numbers are stresses, relative to the least finite yield radius γ of the cells
    that each condition touches. Without cohesion −αp of the stress replaces γ if it is the least.
    Conditions in a cell touch the cell and those that share its facets; conditions on a facet touch
    the cells on both sides. For tension, and where all of these cells are elastic, it is the least
    γ of all cells. The next four numbers are sums of all unbalanced forces. These forces could add
    up, or act on a weaker body than the one where they are.
    :func:`perfplast_fenicsx.proof.lower.measure_stress` computes the same quantities independently.

    Attributes:
        equilibrium: Largest div σ + λb, times the cell's size; in space also jumps of tractions
            between the parts of a cell.
        traction: Largest jump of tractions between cells, or difference from the traction of the
            load.
        shear: Largest tangential traction on contact surfaces without friction.
        tension: Largest tensile traction on surfaces in contact.
        forces: Sum of the magnitudes of all unbalanced forces (force).
        left_of_load: This sum, relative to the forces of the loads of each kind at λ.
        left_of_piece: This sum over the cells that facets join, relative to the loads and contact
            forces on these cells; the largest of all pieces.
        left_of_strength: This sum, relative to the least γV^((d − 1)/d) of all cells that can
            yield, with the volume V.
        overstress: Largest relative excess of stresses over yield, negative in bodies far from
            yield. On surfaces with friction it is that of the shear traction over the strength.
    """

    equilibrium: float
    traction: float
    shear: float
    tension: float
    forces: float
    left_of_load: float
    left_of_piece: float
    left_of_strength: float
    overstress: float

    @property
    def holds(self) -> bool:
        """Whether the stress is admissible, up to rounding."""
        return self.in_equilibrium and self.overstress <= ROUNDING

    @property
    def excess(self) -> float:
        """The largest ratio of unbalanced forces to their limits."""
        return max(self.equilibrium, self.traction, self.shear, self.tension) / ROUNDING

    @property
    def in_equilibrium(self) -> bool:
        """Whether the stress is in equilibrium, up to rounding and to what its reserve can bear."""
        within, on_contact = (self.equilibrium, self.traction), (self.shear, self.tension)
        # All unbalanced forces together, relative to the loads. Bounds are never closer to each
        # other than 1e-4. This is half of a millionth of it, and half of the checker's limit.
        left_of_load = 5e-11
        # The same for one piece: half of the checker's limit.
        left_of_piece = 5e-11
        # All unbalanced forces together, relative to the strength of the weakest cell. If this cell
        # had to bear them all, that would be a ten-millionth of its strength.
        left_of_strength = 1e-7
        # Limit of these forces, relative to the reserve of strength in all cells. A stress that
        # balances them is about ten times as large as they are over the sections.
        of_reserve = 1e-3
        borne = of_reserve * max(-self.overstress, 0.0)
        return (
            all(value <= ROUNDING for value in on_contact)
            and all(value <= max(ROUNDING, borne) for value in within)
            and self.left_of_load <= left_of_load
            and self.left_of_piece <= left_of_piece
            and self.left_of_strength <= max(left_of_strength, borne)
        )


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
    places, at = static.form.places, static.form.places.closing >= 0
    pressing = residual[:count].copy()  # without the pressure that friction bears
    pressing[places.closing[at]] += (places.area * pressure[strains.count :])[at]
    on_facets = residual[:count] / np.repeat(static.form.areas.ravel(), tdim)
    sections = static.form.sections
    inverse = strains.weaknesses(pressure)
    of_facets, of_cells = _weakness(static, inverse)
    inside = strains.inner(residual) / sections[:, None] * of_cells[:, None]
    between = np.abs(on_facets) * of_facets
    others = ~(static.form.jumps | static.form.slips)
    cell_radii = np.divide(1.0, inverse, out=np.full_like(inverse, np.inf), where=inverse > 0)
    largest: Floats = np.array(
        [
            np.abs(inside).max(initial=0),
            between[others].max(initial=0),
            between[static.form.slips].max(initial=0),
            on_facets[static.form.jumps].max(initial=0),
            (yield_ratios(every, pressure, deviator) - 1).max(initial=-1),
            -(cell_radii * sections).min(initial=np.inf),
            -cell_radii.min(initial=np.inf),
        ]
    )
    comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
    in_cells, jump, shear, pull, over = (float(value) for value in largest[:5])
    strength, radius = (-float(value) for value in largest[5:])
    forces = np.abs(residual)
    forces[:count][static.form.jumps] = np.maximum(residual[:count][static.form.jumps], 0.0)
    loaded = static.loaded(load, aside)
    sums: Floats = np.array([forces.sum(), loaded.sum()])
    comm.Allreduce(MPI.IN_PLACE, sums, MPI.SUM)
    missing, whole = (float(value) for value in sums)
    return StaticCertificate(
        equilibrium=in_cells,
        traction=jump,
        shear=shear,
        tension=pull / radius,
        forces=missing,
        left_of_load=missing / whole if whole > 0 else float(missing > 0),
        left_of_piece=_left_of_piece(static, forces, loaded, pressing, cell_radii * sections),
        left_of_strength=missing / strength,
        overstress=over,
    )


def beside_mechanism(
    lower: Bound,
    certificate: StaticCertificate,
    power: float,
    mechanism: fem.Function,
    enough: float = np.inf,
) -> Bound:
    """Return a lower bound after a mechanism has weighted its residuals. Collective.

    Unbalanced forces do work on the mechanism, and change the bound by this work. If the loads
    nearly balance each other, motions per work of the loads are large, and so is the change. Such a
    bound is not called strict.

    Args:
        lower: The bound.
        certificate: Certificate of its stress.
        power: Size that differences of bounds are relative to (:func:`bound.measure_of`).
        mechanism: Velocity of the mechanism.
        enough: Value of the bound that is sufficient.
    """
    mine = float(np.abs(mechanism.x.array).max(initial=0.0))
    speed = mechanism.function_space.mesh.comm.allreduce(mine, MPI.MAX)
    # Work of unbalanced forces on a mechanism with L(v) = 1, relative to its bound. This is half of
    # a millionth of 1e-4, the least distance of two bounds, as others may add them up differently.
    on_mechanism = 5e-11
    work = certificate.forces * speed
    if not lower.strict or lower.value is None or work <= on_mechanism * power:
        return lower
    # relative distance of bounds: the work may be that share of the excess over enough, too
    nearest = 1e-4
    if work <= on_mechanism / nearest * (lower.value - enough):
        return lower
    why = "unbalanced forces by rounding do work on the mechanism"
    return replace(lower, of=Scope.MESH, why_not=(*lower.why_not, why))


def _left_of_piece(
    static: StaticProgram, forces: Floats, loaded: Floats, pressing: Floats, strengths: Floats
) -> float:
    """Return the largest ratio of a piece's unbalanced forces to the forces on it. Collective.

    Args:
        static: The conditions.
        forces: Unbalanced forces of each row.
        loaded: Magnitudes of the loads of each row.
        pressing: Contact forces at jumps, negative in compression, in the facets' rows.
        strengths: Forces that cells can bear.
    """
    form, facets = static.form, static.form.strains.facets
    count, pieces = facets.count, form.pieces
    cells = np.maximum(facets.meet(np.ones(facets.of_cells.shape), across=False), 1.0)
    pushes = np.where(form.jumps | form.pressed, np.maximum(-pressing, 0.0), 0.0)

    def on_both(values: Floats) -> Floats:
        """Return the larger of the values at unknowns and at the opposite ones."""
        return np.maximum(values, facets.meet(facets.gather(values / cells)))

    left, acts = on_both(forces[:count]), loaded[:count] + on_both(pushes)
    inner, wide = (form.strains.inner(of) for of in (forces, loaded)), len(form.areas)
    left, acts, borne = (
        pieces.sums(at.reshape(wide, -1), inside)
        for at, inside in zip(
            (left, acts, np.zeros(count)), (*inner, strengths[:, None]), strict=True
        )
    )
    return largest_left(left, acts, borne)


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
