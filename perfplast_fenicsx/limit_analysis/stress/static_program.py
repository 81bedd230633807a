"""Formulate the lower bound as a conic program, and measure the residuals of its stress."""

from dataclasses import dataclass

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.limit_analysis.conic.conic_program import ConicProgram, Stress
from perfplast_fenicsx.limit_analysis.conic.discretisation import Discretisation
from perfplast_fenicsx.limit_analysis.conic.second_order_cones import yield_ratios
from perfplast_fenicsx.limit_analysis.statements.load_factor import Question
from perfplast_fenicsx.limit_analysis.stress.static_form import StaticForm


@dataclass(frozen=True, eq=False)
class StaticProgram:
    """The conic program of a lower bound, with the mechanical data of its unknowns.

    Attributes:
        program: Program whose velocities are the multipliers of equilibrium.
        form: Form of the bodies, which several programs can share.
        load: Loads L before scaling, in the user's units.
        dead: Constant loads L₀, in the same units.
        free: Loads with a free factor, in the same units.
        before: Number of factorisations of the form's stiffness before this program was created.
    """

    program: ConicProgram
    form: StaticForm
    load: Floats
    dead: Floats
    free: Floats
    before: int

    @property
    def factorisations(self) -> int:
        """Return the number of factorisations of this program so far."""
        return self.form.stiffness.counts.factorisations - self.before

    def destroy(self) -> None:
        """Free the PETSc vectors of the program's loads, but not the form. Collective."""
        for load in (self.program.load, self.program.dead, self.program.free):
            load.destroy()

    def shared_out(self, stress: Stress) -> Stress:
        """Return the stress, with joint shears divided between friction and adhesion.

        Args:
            stress: Stress at all points, in any unit.
        """
        pressure, deviator = stress
        places, count = self.form.places, self.form.strains.count
        found, size = deviator.copy(), places.shares.shape[1]
        found[count:, :size] = places.shared_out(pressure[count:], deviator[count:, :size])
        return pressure, found

    def can_carry(self) -> bool:
        """Return whether a stress, possibly with tensile contact forces, can balance the loads.

        Collective.

        The method ignores the yield conditions. In 2D, the tractions on both sides of a corner may
        be incompatible with every stress in a single cell. In 3D, the four parts of a cell can
        balance all self-equilibrated linear tractions on its facets (:mod:`stress_cells`), and the
        result is True. With bare vertices, the rows of equilibrium are too nearly dependent for
        iterative refinement. The result is then also True, and the iteration has to decide.

        Call this method after :func:`interior_steps.choose_units`, whose factors it uses.
        """
        bare = bool(self.form.strains.idle.any())
        if self.form.strains.gdim == 3 or self.program.comm.allreduce(bare):
            return True
        program = self.program
        flow, left, more = (program.create_vector() for _ in range(3))
        program.load.copy(left)
        largest = PETSc.NormType.NORM_INFINITY
        whole, missing = program.load.norm(largest), np.inf
        # If more than this share of the loads remains unbalanced, no stress can balance the loads.
        # With a shear traction next to a free side, half of the loads remains.
        least_missing = 1e-2
        # Largest number of iterative refinements. Slender bodies move so far that the ridge of K
        # balances a part of their loads.
        most_refinements = 10
        # A refinement has failed if more than this share of the residual remains.
        refined = 0.9
        for _ in range(most_refinements):
            program.stiffness.solve(left, more)
            flow.axpy(1.0, more)
            pressure, deviator = program.viscous_stress(flow)
            program.internal_forces(pressure, deviator, left)
            left.array[program.jumps] += program.springs * flow.array_r[program.jumps]
            left.aypx(-1.0, program.load)
            before, missing = missing, left.norm(largest) / whole
            if missing <= least_missing or not missing < refined * before:
                break
        for vector in (flow, left, more):
            vector.destroy()
        return bool(missing <= least_missing)

    def forces_of_strengths(self, pressure: Floats) -> Floats:
        """Return the force that corresponds to the strength in each row of equilibrium.

        Collective.

        The strength combines the yield radii of all cells at a facet, including cells of bodies in
        contact. The smallest radius has the largest weight, and radii above the program's unit of
        stress count as this unit. If all cells at a facet are elastic, the strength is the smallest
        radius of all cells, as in the proof checker. Without cohesion, the strength depends on the
        stress.

        Args:
            pressure: Mean stress, in the user's units.
        """
        strains, tdim = self.form.strains, self.form.strains.gdim
        least = 1 / self.program.stress_unit
        inverse = strains.weaknesses(pressure)
        everywhere, met, around = self.weakness_around(inverse)
        weakness, inside = (
            np.where(sums > 0, np.maximum(sums, least), max(everywhere, least))
            for sums in (met, np.where(inverse > 0, inverse, around))
        )
        on_facets = np.repeat(self.form.areas.ravel(), tdim) / weakness
        in_cells = self.form.sections / inside
        return np.concatenate([on_facets, np.repeat(in_cells, strains.layout.inner)])

    def weakness_around(self, inverse: Floats) -> tuple[float, Floats, Floats]:
        """Return upper bounds on 1/γ of the cells around facets. Collective.

        The method adds the inverse radii of the cells that meet at a facet. The sum is at most 2
        times the largest inverse radius; at contact, at most 4 times.

        Args:
            inverse: Inverse radii 1/γ of the cells (:meth:`MultiplierStrains.weaknesses`).

        Returns:
            The largest 1/γ of all cells; the sums for the facet unknowns, and the largest sum at a
            facet of each cell, for the unknowns and cells that this rank owns.
        """
        everywhere = self.program.comm.allreduce(float(inverse.max(initial=0.0)), MPI.MAX)
        facets = self.form.strains.facets
        met = facets.meet(np.repeat(inverse[:, None], facets.of_cells.shape[1], axis=1))
        return everywhere, met, facets.gather(met).max(axis=1)


def static_program(form: StaticForm, question: Question, reserve: float) -> StaticProgram:
    """Return the program of a lower bound from its form. Collective.

    Args:
        form: Form of the bodies.
        question: The loads whose factor is sought.
        reserve: See :class:`ConicProgram`.
    """
    loads = question.loads(form.live.copy(), form.dead.copy())
    load, dead, free = (of.array_r.copy() for of in loads)
    before = form.stiffness.counts.factorisations
    on = Discretisation(
        form.comm, form.every, form.whole, *loads, form.open_jumps, proves_stress=True
    )
    return StaticProgram(ConicProgram(on, reserve), form, load, dead, free, before)


DOUBTED = 1e-10
"""Residual, relative to the strengths, above which a bound is in doubt until the proof checker has
judged it."""


@dataclass(frozen=True)
class StaticCertificate:
    """The residuals of a stress in the conditions of a lower bound.

    The first four numbers are stresses, divided by the smallest finite yield radius γ of the cells
    that each condition involves. Without cohesion, −αp replaces γ. A condition in a cell involves
    this cell and the cells that share its facets; a condition on a facet involves the cells on both
    sides. For tension, and if all involved cells are elastic, the divisor is the smallest γ of all
    cells. The proof checker decides by how much these residuals reduce the bound.

    Attributes:
        equilibrium: Largest div σ + λb times the size of the cell; in 3D also the jumps of
            tractions between the parts of a cell.
        traction: Largest jump of the traction between cells, or largest difference from the applied
            traction.
        shear: Largest tangential traction on contact surfaces without friction.
        tension: Largest tensile traction on surfaces in contact.
        left_of_load: Sum of the magnitudes of all unbalanced forces, divided by the sum of the
            magnitudes of the loads of each kind at λ.
        overstress: Largest relative excess of the stress over the yield set, negative if the stress
            is inside everywhere. On surfaces with friction, the excess of the shear traction over
            the strength counts.
    """

    equilibrium: float
    traction: float
    shear: float
    tension: float
    left_of_load: float
    overstress: float

    @property
    def is_doubted(self) -> bool:
        """Return whether the residuals may reduce the bound considerably."""
        return not self.is_balanced or self.overstress > DOUBTED

    @property
    def is_balanced(self) -> bool:
        """Return whether the stress is in equilibrium up to rounding."""
        return max(self.equilibrium, self.traction, self.shear, self.tension) <= DOUBTED


def certify_stress(
    static: StaticProgram, pressure: Floats, deviator: Floats, load: float, aside: float = 0.0
) -> StaticCertificate:
    """Return the residuals of a stress at the points of :class:`MultiplierStrains`. Collective.

    Args:
        static: The conditions.
        pressure: Mean stress in the coordinates of the cones, shape (count,), at the points of
            cells, followed by normal stresses at places of slip (0 if the place cannot open).
        deviator: Deviator in the coordinates of the cones, shape (count, m); at places of slip,
            shear tractions.
        load: Load factor λ.
        aside: Factor of the free loads.
    """
    strains, comm = static.form.strains, static.program.comm
    left = strains.create_vector()
    every = static.program.strains
    every.forces(pressure, deviator, left)
    kinds = np.array([load * static.load, static.dead, aside * static.free])
    residual = left.array_r - kinds.sum(axis=0)
    left.destroy()
    count, tdim = strains.facets.count, strains.gdim
    on_facets = residual[:count] / np.repeat(static.form.areas.ravel(), tdim)
    weakest, met, around = static.weakness_around(strains.weaknesses(pressure))
    of_facets, of_cells = (np.where(sums > 0, sums, weakest) for sums in (met, around))
    inside = strains.inner(residual) / static.form.sections[:, None] * of_cells[:, None]
    between = np.abs(on_facets) * of_facets
    others = ~(static.form.jumps | static.form.slips)
    largest: Floats = np.array(
        [
            np.abs(inside).max(initial=0),
            between[others].max(initial=0),
            between[static.form.slips].max(initial=0),
            on_facets[static.form.jumps].max(initial=0),
            (yield_ratios(every, pressure, deviator) - 1).max(initial=-1),
        ]
    )
    comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
    in_cells, jump, shear, pull, over = (float(value) for value in largest)
    forces = np.abs(residual)
    forces[:count][static.form.jumps] = np.maximum(residual[:count][static.form.jumps], 0.0)
    sums: Floats = np.array([forces.sum(), np.abs(kinds).sum()])
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
