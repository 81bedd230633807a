"""Bound spatially varying strengths by linear functions, and give advice on strengths.

The bound c of a cone, ‖Mσ‖ ≤ c − q·σ, is the product of a number and a profile. For a lower bound,
each cell has a linear function that is nowhere above the profile. For a linear stress, the left
side is then convex in position, and the right side is linear. The stress therefore satisfies the
yield condition in the whole cell if it satisfies this condition at the vertices. For an upper
bound, each cell has a linear function that is nowhere below the profile; the computed dissipation
of a mechanism is then at least the true dissipation. Both bounds are strict.

A slope q that varies with the friction angle has one value for each cell
(:mod:`varying_friction`).
"""

from typing import Literal

from mpi4py import MPI

import numpy as np

from perfplast_fenicsx.arrays import Floats, Longs
from perfplast_fenicsx.compat import interpolation_points
from perfplast_fenicsx.errors import InputError, place_of, raise_together
from perfplast_fenicsx.formulas import ROUNDING
from perfplast_fenicsx.limit_analysis.discrete.body_cones import BodyCones, body_cones
from perfplast_fenicsx.mesh.straight_geometry import corners, has_curved_cells
from perfplast_fenicsx.parallel import sums_at
from perfplast_fenicsx.problem.assembled.spaces import coordinates_of_points
from perfplast_fenicsx.problem.problem import Problem
from perfplast_fenicsx.spatial_fields import SpatialField, varying

Side = Literal["below", "above"]
"""Side of a profile on which a linear function lies."""

PLACE = "the strength of a body"
"""Name of a profile in messages."""


def profiles_in(cones: BodyCones, numbers: Longs, simplices: Floats, side: Side) -> Floats | None:
    """Return linear functions below or above the profiles in simplices. Not collective.

    Args:
        cones: Cones of the bodies.
        numbers: Index of the cone of each simplex, shape (n,).
        simplices: Vertices of the simplices, shape (n, k, d).
        side: Side on which the functions lie.

    Returns:
        Values at the vertices, shape (n, k), 1 for cones whose bound does not vary; None if no
        bound varies.

    Raises:
        InputError: If no linear function on this side of a profile is known.
    """

    def of(profile: SpatialField, here: Longs) -> Floats:
        return profile.between(simplices[here], PLACE)[side == "above"]

    return cones.values(numbers, of)


def steepness_in(cones: BodyCones, numbers: Longs, simplices: Floats, side: Side) -> Floats | None:
    """Return the smallest or the largest factors of the slopes in simplices. Not collective.

    Args:
        cones: Cones of the bodies.
        numbers: Index of the cone of each simplex, shape (n,).
        simplices: Vertices of the simplices, shape (n, k, d).
        side: "below" for the smallest factors, "above" for the largest factors.

    Returns:
        Factors, shape (n,), 1 for cones whose slope does not vary; None if no slope varies.

    Raises:
        InputError: If no bound of a varying sine in a simplex is known.
    """

    def of(sine: SpatialField, here: Longs) -> Floats:
        return sine.between(simplices[here], PLACE)[side == "above"][:, 0]

    return cones.steepness(numbers, of)


def steepness_of_cells(problem: Problem, side: Side) -> Floats | None:
    """Return the factors of :func:`steepness_in` in this rank's cells, shape (num_cells,).

    If no slope varies, the function returns None.

    Args:
        problem: The bodies, on straight cells.
        side: "below" for the smallest factors, "above" for the largest factors.
    """
    vertices, places = corners(problem.tagged_mesh.mesh)
    cones = body_cones(problem)
    return steepness_in(cones, cones.of_cells, places[vertices], side)


def profiles_of_cells(problem: Problem, side: Side) -> Floats | None:
    """Return the linear functions of :func:`profiles_in` in this rank's cells.

    The result has the shape (num_cells, d + 1). If no bound varies, the function returns None.

    Args:
        problem: The bodies, on straight cells.
        side: Side on which the functions lie.
    """
    vertices, places = corners(problem.tagged_mesh.mesh)
    cones = body_cones(problem)
    return profiles_in(cones, cones.of_cells, places[vertices], side)


def strengths_at_points(problem: Problem, numbers: Longs) -> tuple[Floats | None, Floats | None]:
    """Return the profiles, and the factors of the slopes, at the points of this rank. Collective.

    If the points are the vertices v of a cell (:mod:`stress_cells`), the profile is (c_v + Σ_w
    c_w)/(d + 2). Here c is a linear function that is nowhere below the profile, and the sum is over
    all vertices of the cell. For any linear function f, the mean over the vertices of this value
    times f then equals the mean of c f in the cell. The factor at these points is the largest
    factor in the cell, because upper bounds need the largest factor.

    Args:
        problem: The bodies.
        numbers: Index of the cone of each point.

    Returns:
        Arrays of shape (num_points,); None if no bound, or no slope, varies.
    """
    cones = body_cones(problem)
    if not cones.varies:
        return None, None
    if not _are_at_vertices(problem):
        x = coordinates_of_points(problem.Q)[: len(numbers)]

        def of(field: SpatialField, here: Longs) -> Floats:
            return field.at(x[here], PLACE)

        return cones.values(numbers, of), cones.steepness(numbers, of)
    above, steepness = profiles_of_cells(problem, "above"), steepness_of_cells(problem, "above")
    points = problem.Q.dofmap.list[: len(cones.of_cells)]
    profile, steepest = np.ones(len(numbers)), np.ones(len(numbers))
    if above is not None:
        means = (above + above.sum(axis=1, keepdims=True)) / (above.shape[1] + 1)
        profile[points] = means
    if steepness is not None:
        steepest[points] = steepness[:, None]
    return None if above is None else profile, None if steepness is None else steepest


def _are_at_vertices(problem: Problem) -> bool:
    """Return whether the points are the vertices of their cells."""
    reference = interpolation_points(problem.S.element)
    places = np.hstack([1 - reference.sum(axis=1, keepdims=True), reference])
    square = places.shape[0] == places.shape[1]
    return square and bool(np.allclose(places, np.eye(len(places))))


def check_profiles(problem: Problem) -> None:
    """Check that strict bounds support the spatial variation of all strengths. Collective.

    Raises:
        InputError: If strengths vary in axisymmetry, if no linear bounds of a profile are known in
            a cell, or if the lower linear bound is not positive.
    """
    if not body_cones(problem).varies or has_curved_cells(problem.tagged_mesh.mesh):
        return
    if problem.tagged_mesh.axisymmetric:
        name, fields = next(iter(varying_of(problem).items()))
        verb = "varies" if len(fields) == 1 else "vary"
        raise InputError(
            f"{' and '.join(fields)} of '{name}' {verb} in space, but strict bounds in axisymmetry "
            "need constant values; give a separate body for each layer, or control = 'work' with "
            "until = 'limit' for an estimate of the limit load."
        )
    message = None
    try:
        steepness_of_cells(problem, "below")
        low = profiles_of_cells(problem, "below")
        if low is not None and (wrong := ~(low > 0).all(axis=1)).any():
            vertices, places = corners(problem.tagged_mesh.mesh)
            cell = int(np.argmax(wrong))
            where = place_of(places[vertices[cell]].mean(axis=0))
            tagged_mesh = problem.tagged_mesh
            named = (name for name in tagged_mesh.volumes if cell in tagged_mesh.cells(name))
            message = (
                f"the strength of '{next(named)}' varies so steeply in the cell at {where} that no "
                "positive linear lower bound is known there; refine the mesh there, or draw lines "
                "where the gradient of the strength changes."
            )
    except InputError as error:
        message = str(error)
    raise_together(problem.comm, message)


def profiles_in_words(problem: Problem) -> tuple[str, ...]:
    """Return clauses on how bounds approximate nonlinear strengths. Collective."""
    if not body_cones(problem).varies or has_curved_cells(problem.tagged_mesh.mesh):
        return ()
    low, high = profiles_of_cells(problem, "below"), profiles_of_cells(problem, "above")
    flat, steep = steepness_of_cells(problem, "below"), steepness_of_cells(problem, "above")
    found = []
    for name, fields in varying_of(problem).items():
        cells = problem.tagged_mesh.cells(name)
        apart = np.zeros(2)
        for i, (least, most) in enumerate(((low, high), (flat, steep))):
            if least is not None and most is not None:
                mine = cells[cells < len(least)]
                apart[i] = ((most[mine] - least[mine]) / most[mine]).max(initial=0.0)
        problem.comm.Allreduce(MPI.IN_PLACE, apart, MPI.MAX)
        if apart[1] > ROUNDING:
            found.append(
                f"the friction_angle of '{name}' varies within cells: the lower bound uses the"
                " smallest angle in each cell, the upper bound the largest; their sines differ"
                f" by up to {apart[1]:.2g} of the larger sine, and both bounds are strict"
            )
        elif apart[0] > ROUNDING:
            found.append(
                f"the {' and '.join(fields)} of '{name}' is not linear in each cell: the lower"
                " bound uses a linear function below it, the upper bound a linear function above"
                f" it; the functions differ by up to {apart[0]:.2g} of the strength, and both"
                " bounds are strict"
            )
    return tuple(found)


def varying_of(problem: Problem) -> dict[str, dict[str, SpatialField]]:
    """Return the spatial fields of materials, by volume and parameter."""
    given = problem.given.materials
    found = {name: varying(given[name]) for name in sorted(given)}
    return {name: fields for name, fields in found.items() if fields}


NOTICED = 1e-3
"""Largest share of an upper bound that may come from rounding without a message to the user."""

RESOLVED = 1e5
"""Ratio of strengths up to which the unbalanced forces in weak bodies are far below 1e-9 of the
weak bodies' strength. The rounding errors of strong bodies (1e-15) limit this accuracy.
"""


def strong_bodies(problem: Problem, share: float) -> tuple[str, ...]:
    """Return advice on bodies so strong that their rounding may cause a share of an upper bound.

    The result is empty if no body is so strong. Collective.

    Args:
        problem: The bodies.
        share: Share of the upper bound that may come from rounding, which the advice states.
    """
    radii = _radii(problem)
    least, largest = min(radii.values(), default=np.inf), max(radii.values(), default=0.0)
    few = max(RESOLVED * least, NOTICED * largest)
    strong = {name: radius / least for name, radius in radii.items() if radius > few}
    if not strong:
        return ()
    return (
        f"{share:.1%} of the upper bound may come from rounding in the strain rates of"
        f' {_told(strong)} as strong as the weakest body; give {_them(strong)} law = "elastic"',
    )


def weak_bodies(problem: Problem) -> tuple[str, ...]:
    """Return advice if weak bodies prevent a lower bound because of rounding. Collective.

    The result is empty if no body is too weak.
    """
    radii = _radii(problem)
    largest = max(radii.values(), default=0.0)
    weak = {name: radius / largest for name, radius in radii.items() if RESOLVED * radius < largest}
    if not weak:
        return ()
    return (
        f"{_told(weak)} as strong as the strongest body, so rounding in the strong bodies hides the"
        f" balance of the weak; leave {_them(weak)} out of the mesh if no loads pass through, or"
        ' give the strong bodies law = "elastic"',
    )


def held_bodies(problem: Problem) -> tuple[str, ...]:
    """Return advice on bodies that cannot yield and whose own supports resist their loads.

    These bodies carry any load. An example is a rigid wall whose toe shares nodes with supported
    ground. Collective.
    """
    V, comm = problem.V, problem.comm
    gdim, owned = problem.bodies.gdim, V.dofmap.index_map.size_local
    live = problem.loads.live.array_r.reshape(owned, gdim)
    stiff = sorted(problem.tagged_mesh.volumes.keys() - _radii(problem, least=0.0).keys())
    told = []
    for name in stiff:
        nodes = V.dofmap.list[problem.tagged_mesh.cells(name)]
        mine = sums_at(V.dofmap.index_map, 1, (nodes.ravel(), 1.0))[:owned, 0] > 0
        sums = np.stack([live[mine].sum(axis=0), np.abs(live[mine]).sum(axis=0)])
        force, size = comm.allreduce(sums)
        held = comm.allreduce(problem.fixed[:owned][mine].sum(axis=0)) > 0
        rounding = 1e-9
        against = held & (np.abs(force) > rounding * size.sum())
        axes = [axis for axis, is_so in zip("xyz", against, strict=False) if is_so]
        if axes:
            told.append(
                f"supports hold nodes of '{name}', which does not yield, along {', '.join(axes)}"
                " against its loads; separate it from the supported body by a contact, or end the"
                " supports before its nodes"
            )
    return tuple(told)


def _radii(problem: Problem, least: float = np.finfo(float).tiny) -> dict[str, float]:
    """Return the smallest yield radius of each body that can yield. Collective.

    Cohesionless ground has a radius of 0, because its strength depends on the pressure. It is in
    the result only if ``least`` is 0.

    Args:
        problem: The bodies.
        least: Smallest radius of bodies in the result.
    """
    found, (of_cells, *_) = {}, body_cones(problem).at_cells()
    profile = profiles_of_cells(problem, "below")
    if profile is not None:
        of_cells = of_cells * profile.min(axis=1)
    for name in sorted(problem.tagged_mesh.volumes):
        cells = problem.tagged_mesh.cells(name)
        mine = float(of_cells[cells[cells < len(of_cells)]].min(initial=np.inf))
        radius = problem.comm.allreduce(mine, MPI.MIN)
        if np.isfinite(radius) and radius >= least:
            found[name] = radius
    return found


def _told(ratios: dict[str, float]) -> str:
    """Return the names of bodies with their strength ratios, as words."""
    return ", ".join(f"'{name}', {ratio:.0e} times" for name, ratio in ratios.items())


def _them(ratios: dict[str, float]) -> str:
    """Return "it" for one body and "them" for several bodies."""
    return "it" if len(ratios) == 1 else "them"


def check_cohesion(problem: Problem) -> None:
    """Check that bodies without any cohesion have constant loads and loads that grow. Collective.

    Raises:
        InputError: If no body has cohesion, unless some loads are constant and others grow.
    """
    grows, stays = problem.loads.grows(), problem.loads.has_dead()
    radii = [cone.standard.radius for cone in body_cones(problem).cones]
    plastic = [radius for radius in radii if np.isfinite(radius)]
    if plastic and not any(plastic) and not (grows and stays):
        raise InputError(
            "cohesion = 0: ground without cohesion has a finite, nonzero limit load only if "
            "constant loads compress it while other loads grow; give constant loads and one that "
            "grows, or a small cohesion."
        )
