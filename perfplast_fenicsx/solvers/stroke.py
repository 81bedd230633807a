"""Choose load factors of a loading by given motions, from first yield to the end."""

from perfplast_fenicsx.solvers.level_solver import LevelSolver

GROWTH = 1.5
"""Growth from one load factor to the next."""


def stroke(solver: LevelSolver, until: float) -> list[float]:
    """Return load factors from first yield to the last one. Collective.

    First yield is an estimate if there are gaps or constant loads.

    Args:
        solver: Solver of a problem in which ζ moves something; the function changes its iterate.
        until: The last load factor.

    Raises:
        LinearFailure: If the elastic problem cannot be solved.
    """
    iterate, program = solver.iterate, solver.program
    solver.problem.move_to(until)
    active = iterate.begin(None)
    program.set_operator(iterate.operator(1.0))
    found = program.solve(iterate.gradient(until), iterate.room(), active, rtol=1e-8)
    iterate.aim(found.delta)
    iterate.advance(1.0)
    overstress = iterate.fields.largest_overstress()
    values = [until]
    if overstress > 1:
        first = until / overstress
        while values[0] / first > GROWTH:
            values.insert(0, values[0] / GROWTH)
        values.insert(0, first)
    return values
