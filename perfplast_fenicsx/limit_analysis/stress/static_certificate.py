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
"""Limit of a residual, relative to the least yield radius of the cells it touches. Mean stresses,
which nothing bounds, may be 1e5 times as large, and have their own rounding."""


@dataclass(frozen=True)
class StaticCertificate:
    """How far a stress is from being admissible.

    The first four are stresses relative to the least finite yield radius γ (without cohesion what
    the stress itself has in its place, −αp, where that is least) of the cells that each
    condition touches: of a cell itself and those that share its facets, of a facet those on both
    sides; of tension, and where all of these are elastic, to the least γ of all. The next four are
    sums of all unbalanced forces, since these could add up, or act on a weaker body than those in
    which they are. :func:`perfplast_fenicsx.proof.lower.measure_stress` computes the same
    quantities independently.

    Attributes:
        equilibrium: Largest div σ + λb, times the cell's size; in space also jumps of tractions
            between the parts of a cell.
        traction: Largest jump of tractions between cells, or traction that is not that of the load.
        shear: Largest tangential traction on surfaces in contact that do not rub.
        tension: Largest pull on surfaces in contact.
        forces: The sum of the magnitudes of all forces without balance, a force.
        left_of_load: The same sum, relative to those of the loads of each kind at λ.
        left_of_piece: The same sum of the cells that facets join, relative to the loads and forces
            of contact on these; of several pieces the largest.
        left_of_strength: The same sum, relative to the least γV^((d − 1)/d) of all cells that can
            yield, V being the volume.
        overstress: By how much stresses exceed yield, relative, where that is largest, negative in
            bodies far from yield; where surfaces rub the same of the shear traction and what it may
            be.
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
        """Whether the stress is admissible, but for rounding."""
        return self.in_equilibrium and self.overstress <= ROUNDING

    @property
    def excess(self) -> float:
        """By what factor forces without balance exceed what may be left, where that is most."""
        return max(self.equilibrium, self.traction, self.shear, self.tension) / ROUNDING

    @property
    def in_equilibrium(self) -> bool:
        """Whether the stress is in equilibrium, but for rounding and what its reserve can bear."""
        within, on_contact = (self.equilibrium, self.traction), (self.shear, self.tension)
        # All forces without balance together, relative to the loads: bounds are never sought nearer
        # to each other than 1e-4, and this is half of a millionth of it: half of what is left to
        # whoever checks it.
        left_of_load = 5e-11
        # The same of one piece, half of what is left to whoever checks it.
        left_of_piece = 5e-11
        # All forces without balance together, relative to what the weakest cell can bear: even if
        # one cell had to bear them all, that would be a ten-millionth of its strength.
        left_of_strength = 1e-7
        # What these forces may be, relative to the strength that all cells have in reserve. A
        # stress that balances them is some ten times as large as they are over the sections.
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
    """Judge a stress at the points of :class:`MultiplierStrains`. Collective.

    Args:
        static: The conditions.
        pressure: Pressure of the stress in the coordinates of the cones, shape (count,). Zero at
            places of slip, which follow the points.
        deviator: The same, shape (count, m); shear tractions there.
        load: λ.
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
    pressing = residual[:count].copy()  # where friction bears what presses too, without it
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
    """Return a lower bound after its residuals have been weighed by a mechanism. Collective.

    Forces without balance do work on the mechanism, and change the bound by as much: where the
    loads nearly balance each other, and motions per work of the loads are large, by more than their
    sum. No such bound is called strict.

    Args:
        lower: The bound.
        certificate: Certificate of its stress.
        power: What differences of bounds are measured by (:func:`bound.measure_of`).
        mechanism: Its velocity.
        enough: What the bound is to be at least, where no more is asked.
    """
    mine = float(np.abs(mechanism.x.array).max(initial=0.0))
    speed = mechanism.function_space.mesh.comm.allreduce(mine, MPI.MAX)
    # Work of the forces without balance on a mechanism with L(v) = 1, relative to its bound: half
    # of a millionth of 1e-4, the least distance of two bounds, as others may add up otherwise.
    on_mechanism = 5e-11
    work = certificate.forces * speed
    if not lower.strict or lower.value is None or work <= on_mechanism * power:
        return lower
    nearest = 1e-4  # bounds, relative: so work may be that part of what is beyond enough, too
    if work <= on_mechanism / nearest * (lower.value - enough):
        return lower
    why = "what rounding leaves of its balance does work on the mechanism"
    return replace(lower, of=Scope.MESH, why_not=(*lower.why_not, why))


def _left_of_piece(
    static: StaticProgram, forces: Floats, loaded: Floats, pressing: Floats, strengths: Floats
) -> float:
    """Forces without balance of one piece beside what acts on it, the largest. Collective.

    Args:
        static: The conditions.
        forces: Without balance, of each row.
        loaded: Magnitudes of its loads.
        pressing: What presses at jumps, where it is negative, of the facets' rows.
        strengths: Forces that cells bear.
    """
    form, facets = static.form, static.form.strains.facets
    count, pieces = facets.count, form.pieces
    cells = np.maximum(facets.meet(np.ones(facets.of_cells.shape), across=False), 1.0)
    pushes = np.where(form.jumps | form.pressed, np.maximum(-pressing, 0.0), 0.0)

    def on_both(values: Floats) -> Floats:
        """Return values at unknowns, and at the opposite ones too."""
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
    """At least 1/γ of the weakest cell that each condition touches. Collective.

    Inverse radii are added up where cells meet, which is more than the largest of them by a factor
    of at most 2, and of 4 beside contact.

    Args:
        static: The conditions.
        inverse: 1/γ of the cells (:meth:`MultiplierStrains.weaknesses`).

    Returns:
        Of the facets' unknowns that this rank owns, and of its cells.
    """
    facets = static.form.strains.facets
    everywhere = static.program.comm.allreduce(float(inverse.max(initial=0)), MPI.MAX)
    met = facets.meet(np.repeat(inverse[:, None], facets.of_cells.shape[1], axis=1))
    around = facets.gather(met).max(axis=1)
    of_facets, of_cells = (np.where(sums > 0, sums, everywhere) for sums in (met, around))
    return of_facets, of_cells
