"""The load factors of a loading by given motions, chosen from first yield to its end."""

from perfplast_fenicsx.solvers.level_solver import LevelSolver

GROWTH = 1.5
"""From one load factor to the next."""


def stroke(solver: LevelSolver, until: float) -> list[float]:
    """Load factors from first yield on to the last one. Collective.

    First yield is a guess where there are gaps or constant loads.

    Args:
        solver: Solver of a problem in which ζ moves something; its iterate is changed.
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
