"""Write the loading of a first case: bounds of the bodies if they are available and affordable."""

from collections.abc import Iterator, Mapping

from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.survey import Survey

ADAPTED = {2: 20_000, 3: 9_000}
"""Largest number of cells for which the case also adapts the mesh, which takes three to five times
as long."""

IN_CONTACT = 2 / 3
"""Factor of these for bodies in contact, which makes factorisations larger."""


BOUNDS = """\
[loading]
control = "bounds"              # what the bodies carry, and what they do not, for certain
"""

ADAPT = """\
limit_tolerance = 5e-3          # of each bound, beside their distance below

[mesh]                          # finer ones until bounds are {percent:.0f} % apart, or so fine
adapt = {{ until = {until}, cells = {cells} }}
"""

ONE_MESH = """\
# on this mesh alone, since {why}
"""

ESTIMATE = """\
[loading]
control = "work"                # no control = "bounds", since {why}
until = "limit"                 # of the mesh: an estimate, which may lie above what bodies carry
"""


def loading_for(survey: Survey, options: MeshingOptions) -> str:
    """Return ``[loading]`` and ``[mesh]`` of a first case, with the reason if it has no bounds.

    Args:
        survey: Survey of bodies, joints and faces. All bodies yield by one law, and all loads grow.
        options: Options of the mesher.
    """
    why = next(_against(survey, options), None)
    if why is not None:
        return ESTIMATE.format(why=why)
    why = next(_against_adapting(survey), None)
    if why is not None:
        return BOUNDS + ONE_MESH.format(why=why)
    growth = 2.0  # ratio of the most cells of the last mesh to those of the first
    cells = round(growth * _most(survey, ADAPTED))
    until = 0.1  # relative distance of the bounds at which refinement ends
    return BOUNDS + ADAPT.format(percent=100 * until, until=until, cells=cells)


def _against(survey: Survey, options: MeshingOptions) -> Iterator[str]:
    """Yield reasons against bounds."""
    if survey.joints and options.meshed == "apart" and survey.dim == 3:
        yield ("none are available where the nodes of bodies in space do not match (meshed apart)")
    if survey.degree > 1:
        yield "none are available for curved elements (order = 2)"
    # Cells by dimension up to which a first case computes bounds: some minutes on one core.
    affordable = {2: 60_000, 3: 30_000}
    if (cells := _cells(survey)) > _most(survey, affordable):
        yield f"they take long on {cells} elements (a larger size has fewer)"


def _against_adapting(survey: Survey) -> Iterator[str]:
    """Yield reasons for bounds on one mesh only."""
    if _cells(survey) > _most(survey, ADAPTED):
        yield f"finer meshes than {_cells(survey)} elements take long; see adapt under [mesh]"


def _most(survey: Survey, cells: Mapping[int, int]) -> float:
    return cells[survey.dim] * (IN_CONTACT if survey.joints else 1.0)


def _cells(survey: Survey) -> int:
    return sum(body.cells for body in survey.bodies)
