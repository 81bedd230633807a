"""The loading of a first case: bounds of the bodies where they are known and affordable."""

from collections.abc import Iterator, Mapping

from perfplast_fenicsx.geometry.meshing_options import MeshingOptions
from perfplast_fenicsx.geometry.survey import Survey

ADAPTED = {2: 20_000, 3: 9_000}
"""Cells up to which it has the mesh adapted as well, which takes three to five times as long."""

IN_CONTACT = 2 / 3
"""Share of these that bodies may have which touch, as contact makes factors larger."""


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
    """``[loading]`` and ``[mesh]`` of a first case, with the reason where no bounds are asked for.

    Args:
        survey: Survey of bodies, joints and faces; all bodies yield by one law, and all loads grow.
        options: Options of the mesher.
    """
    why = next(_against(survey, options), None)
    if why is not None:
        return ESTIMATE.format(why=why)
    why = next(_against_adapting(survey), None)
    if why is not None:
        return BOUNDS + ONE_MESH.format(why=why)
    growth = 2.0  # how many times the most cells of the first mesh the last one may have
    cells = round(growth * _most(survey, ADAPTED))
    until = 0.1  # distance of the bounds, relative, at which the meshes end
    return BOUNDS + ADAPT.format(percent=100 * until, until=until, cells=cells)


def _against(survey: Survey, options: MeshingOptions) -> Iterator[str]:
    """Why no bounds are asked for."""
    if survey.joints and options.meshed == "apart" and survey.dim == 3:
        yield "none are known where the nodes of bodies in space do not match (meshed apart)"
    if survey.degree > 1:
        yield "none are known of curved elements (order = 2)"
    # Cells by dimension up to which a first case asks for bounds: some minutes on one core.
    affordable = {2: 60_000, 3: 30_000}
    if (cells := _cells(survey)) > _most(survey, affordable):
        yield f"they take long on {cells} elements (a larger size has fewer)"


def _against_adapting(survey: Survey) -> Iterator[str]:
    """Why bounds are asked for on one mesh."""
    if _cells(survey) > _most(survey, ADAPTED):
        yield f"finer ones than {_cells(survey)} elements take long; see adapt under [mesh]"


def _most(survey: Survey, cells: Mapping[int, int]) -> float:
    return cells[survey.dim] * (IN_CONTACT if survey.joints else 1.0)


def _cells(survey: Survey) -> int:
    return sum(body.cells for body in survey.bodies)
