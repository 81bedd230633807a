"""Solve one dual program of Total FETI: active rows, bounds, and δ from its multipliers.

With F = B K⁺Bᵀ, d = B K⁺f − c, G = RᵀBᵀ and e = Rᵀf,

    minimise ½ λᵀFλ − dᵀλ  where  Gλ = e,  λ ≥ lower

is solved for the difference x of λ from forces that balance every piece, so that Gx = 0. The
gradient Fλ − d is the jump of the rows apart from rigid motions Rα of the pieces, and α are the
multipliers of Gλ = e.
"""

import numpy as np

from perfplast_fenicsx.arrays import Floats
from perfplast_fenicsx.solvers.tfeti.dual_operator import DualOperator
from perfplast_fenicsx.solvers.tfeti.mprgp import Operator
from perfplast_fenicsx.solvers.tfeti.smalbe import DualProgram, Smalbe


class TornProgram:
    """The dual of one contact QP during its solution. All methods are collective.

    Attributes:
        smalbe: The iteration.
        jumps: Scale of the jumps, to which tolerances refer.
        forces: Scale of the multipliers that close them.
    """

    def __init__(
        self,
        dual: DualOperator,
        precondition: Operator,
        f: Floats,
        c: Floats,
        lower: Floats,
        start: Floats,
    ) -> None:
        """Start at given multipliers.

        Args:
            dual: F of the active rows.
            precondition: Function that approximates its inverse.
            f: Forces on torn unknowns.
            c: Required values of the rows, or their upper bounds.
            lower: Bounds of λ.
            start: Initial λ.
        """
        coarse, K, comm = dual.coarse, dual.stiffness, dual.comm
        self._dual, self._f, self._lower = dual, f, lower
        self._d = dual.rows(K.solve(f)) - c
        missing = coarse.lift(coarse.solve(coarse.resultants(f) - coarse.balance(start)))
        self._shift = start + missing
        moved = dual.multiply(self._shift)
        P = coarse.project
        program = DualProgram(
            comm=comm,
            multiply=lambda x: P(dual.multiply(x)),
            project=P,
            precondition=precondition,
            norm=dual.norm,
            b=P(self._d - moved),
            lower=lower - self._shift,
        )
        length = program.length
        self.jumps = length(program.b)
        self.forces = max(length(missing), self.jumps / dual.norm if dual.norm > 0 else 0.0)
        # Relative residual of forces and jumps that counts as rounding.
        rounding = 1e-14
        self._least_jumps = rounding * (length(self._d) + length(moved))
        self._least_forces = rounding * length(self._shift)
        self.smalbe = Smalbe(program, np.zeros(dual.size))

    def run(self, rtol: float, most: int) -> bool:
        """Iterate until jumps and unbalanced forces are small, and return whether they are.

        Args:
            rtol: Tolerance relative to ``jumps`` and ``forces``; rounding is accepted.
            most: Largest number of products with F.

        Returns:
            Whether they are small.
        """
        jumps = max(rtol * self.jumps, self._least_jumps)
        forces = max(rtol * self.forces, self._least_forces)
        return self.smalbe.run(jumps, forces, most)

    def at_rounding(self, rtol: float) -> bool:
        """Return whether a smaller tolerance makes no sense."""
        return rtol * self.jumps <= self._least_jumps and rtol * self.forces <= self._least_forces

    def multipliers(self) -> Floats:
        """Return λ, exactly within its bounds."""
        bounded = self.smalbe.x <= self._lower - self._shift
        return np.where(bounded, self._lower, np.maximum(self._shift + self.smalbe.x, self._lower))

    def displacement(self, multipliers: Floats) -> Floats:
        """Return δ on torn unknowns."""
        coarse, K, dual = self._dual.coarse, self._dual.stiffness, self._dual
        gradient = dual.multiply(multipliers) - self._d
        amplitudes = coarse.solve(coarse.balance(gradient - self.smalbe.multiplier))
        return K.solve(self._f - dual.forces(multipliers)) + coarse.motion(amplitudes)
