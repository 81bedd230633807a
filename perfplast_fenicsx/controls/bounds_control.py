"""Bounds of the limit load that hold for the bodies."""

from dataclasses import dataclass

from perfplast_fenicsx.controls.control import OfBody, Run
from perfplast_fenicsx.controls.given import Given
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import adaptive_bounds
from perfplast_fenicsx.limit_analysis.body.limit_bounds import limit_bounds
from perfplast_fenicsx.limit_analysis.discrete.limit_load import LimitLoad
from perfplast_fenicsx.limit_analysis.statements.design_factor import check_design
from perfplast_fenicsx.limit_analysis.statements.limit_checks import check_tolerance


@dataclass(frozen=True)
class BoundsControl(OfBody):
    """No loading: bounds of the limit load that hold for the body, and not just for its mesh.

    Args:
        limit_tolerance: How near each bound comes to the best of its kind on this mesh, relative,
            between 0 and 1.
        design: Load factor of the load that the bodies are designed for, often 1.0: results tell
            how many times it is carried.

    Raises:
        InputError: A tolerance or a load factor that is none.
    """

    limit_tolerance: float = 1e-4
    design: float | None = None

    def __post_init__(self) -> None:
        check_tolerance(self.limit_tolerance)
        check_design(self.design)

    def check(self, given: Given) -> None:
        """Refuse bodies without loads, and obstacles that move."""
        given.require_load()
        given.refuse_moves()

    def find(self, run: Run) -> LimitLoad:
        """Find the bounds, of the mesh or of several that are adapted. Collective."""
        problem, record = run.problem, run.record
        if run.adapt is None:
            body = limit_bounds(problem, self.limit_tolerance, record.interior)
            record.limit(body.mesh, body)
            return body.mesh
        told = (record.mesh, record.interior)
        found = adaptive_bounds(problem, run.adapt, self.limit_tolerance, *told, self.design)
        record.limit(found.best.mesh, found.body, found)
        return found.best.mesh
