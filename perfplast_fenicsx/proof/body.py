"""Store the bodies of one half of a proof: cells, strengths, loads, supports and contact."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from perfplast_fenicsx.proof.cell_shapes import check_cells, check_sections, in_order_of, with_kind
from perfplast_fenicsx.proof.cones import Cones
from perfplast_fenicsx.proof.exact_shapes import Shapes, shapes_of
from perfplast_fenicsx.proof.guided import with_guided
from perfplast_fenicsx.proof.load_kinds import EVERY, KINDS, NAMES, Loads, with_all
from perfplast_fenicsx.proof.plain_arrays import ProofError, check_sizes, checked, equal
from perfplast_fenicsx.proof.rubbing import OF as RUBBING
from perfplast_fenicsx.proof.rubbing import fault_of, with_rubbing


def with_rigid(arrays: Mapping[str, npt.NDArray]) -> dict[str, npt.NDArray]:
    """Return the arrays; a file without rigid surfaces gets empty arrays for them."""
    d = np.shape(arrays.get("vertices", ()))[1:]
    none: dict[str, npt.NDArray] = {}
    if "rigid" not in arrays:
        none["rigid"] = np.zeros(0, dtype=np.int64)
        none["rigid_held"] = np.zeros((0, *d), dtype=np.uint8)
    return {**none, **arrays}


Floats = npt.NDArray[np.float64]
Longs = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Body:
    """The bodies of dimension d, as stored in the file. Stresses and loads have the same units.

    Attributes:
        vertices: Coordinates, shape (num_vertices, d).
        cells: Vertices of the cells, shape (num_cells, d + 1).
        cone: Index of the cone that bounds the stress of each cell, shape (num_cells,); −1 for
            elastic and rigid cells, which carry any stress. If all entries are −1, only contacts
            and obstacles limit the load (:mod:`blocks`).
        cone_bound: Bound c ≥ 0 of each cone ‖Mσ‖ ≤ c − q·σ (:class:`cones.Cones`), shape
            (num_cones,).
        cone_slope: Slope q of each cone, shape (num_cones, m), with m = 3 in 2D, 4 in axisymmetry
            and 6 in 3D.
        cone_matrix: Matrix M of each cone, shape (num_cones, m, m).
        cone_sine: Sine s of each bound (1 + s)σ₁ − (1 − s)σ₃ ≤ c of principal stresses, for which q
            = 0 and M = 0; NaN for other cones; shape (num_cones,).
        cone_tension: Tensile strength f of each additional condition σ₁ ≤ f; NaN for cones without
            this condition; shape (num_cones,).
        cone_curvature: Factor k of each parabola R² ≤ k (c − σ₁) of in-plane stresses
            (:mod:`parabola`), for which q = 0 and M = 0; NaN for other cones; shape (num_cones,).
        cell_strength: Positive factor of c at the vertices of each cell, linear in the cell, shape
            (num_cells, d + 1); 1 for a uniform strength.
        sought: The loads whose factor λ is bounded, at λ = 1.
        constant: Constant loads, which λ does not multiply.
        others: Free loads, which may have any factor, at factor 1.
        facets: Vertices of the outer facets, shape (num_facets, d).
        surface: Tag of each facet's surface; 0 if the facet is on no surface.
        revolved: Whether the cells are sections of rings around x = 0; False by default.
        held: Flags of the velocity components that are zero on each facet, shape (num_facets, d).
        guided: Unit vector of an additional direction in which the velocity of each facet is zero;
            0 for facets without such a direction; shape (num_facets, d).
        rigid: Tags of surfaces that are glued to a rigid plate, which the loads move.
        rigid_held: Flags of the components of each plate's velocity that are zero, shape
            (num_rigid, d). A plate with a held component does not rotate.
        contacts: Tags of the two surfaces of each contact, which cannot penetrate each other, shape
            (num_contacts, 2).
        contact_adhesion: Shear stress c at which each contact slips without pressure.
        contact_friction: Coefficient of friction μ ≥ 0 of each contact: μ times the pressure is
            added to the shear limit.
        obstacles: Tags of surfaces that cannot penetrate a half space.
        obstacle_normals: Unit vectors into the obstacles, shape (num_obstacles, d).
        obstacle_adhesion: Adhesion of each obstacle, as for contacts.
        obstacle_friction: Coefficient of friction of each obstacle, as for contacts.
    """

    vertices: Floats
    cells: Longs
    cone: Longs
    cone_bound: Floats
    cone_slope: Floats
    cone_matrix: Floats
    cone_sine: Floats
    cone_tension: Floats
    cone_curvature: Floats
    cell_strength: Floats
    sought: Loads
    constant: Loads
    others: Loads
    facets: Longs
    surface: Longs
    revolved: Flags
    held: Flags
    guided: Floats
    rigid: Longs
    rigid_held: Flags
    contacts: Longs
    contact_adhesion: Floats
    contact_friction: Floats
    obstacles: Longs
    obstacle_normals: Floats
    obstacle_adhesion: Floats
    obstacle_friction: Floats

    def __post_init__(self) -> None:
        n, d = self.vertices.shape if self.vertices.ndim == 2 else (0, 0)
        counted = (self.cells, self.facets, self.obstacles, self.contacts, self.rigid)
        c, f, k, pairs, rigid = (a.shape[0] if a.ndim else 0 for a in counted)
        shapes = {
            "cells": (c, d + 1),
            "cone": (c,),
            "cell_strength": (c, d + 1),
            "facets": (f, d),
            "surface": (f,),
            "revolved": (),
            "held": (f, d),
            "guided": (f, d),
            "rigid": (rigid,),
            "rigid_held": (rigid, d),
            "contacts": (pairs, 2),
            "obstacles": (k,),
            "obstacle_normals": (k, d),
            **{name: (pairs if of == "contacts" else k,) for name, of in RUBBING.items()},
        }
        wrong = [name for name, shape in shapes.items() if getattr(self, name).shape != shape]
        of_loads = ((c, d), (f, d, d), (c, d + 1), (rigid, d), (rigid, 2 * d - 3))
        kinds = dict(zip(KINDS, (self.sought, self.constant, self.others), strict=True))
        for prefix, loads in kinds.items():
            shown = zip(NAMES, of_loads, strict=True)
            wrong += [prefix + n for n, shape in shown if getattr(loads, n).shape != shape]
        if d not in (2, 3) or wrong:
            raise ProofError(
                f"the shape of {', '.join(wrong) or 'vertices'} does not fit the bodies."
            )
        if not c:
            raise ProofError("the file has no cells, so there is nothing to check.")
        for name in ("cells", "facets"):
            numbers = getattr(self, name)
            if numbers.size and not (numbers.min() >= 0 and numbers.max() < n):
                raise ProofError(f"{name} names vertices that do not exist.")
        every = (getattr(loads, name) for loads in kinds.values() for name in NAMES)
        known = (self.vertices, *every, self.obstacle_normals, self.guided)
        if not all(np.isfinite(values).all() for values in known):
            raise ProofError("vertices, loads or normals are not finite.")
        self.cones.check(self.components)
        if not ((self.cone >= -1) & (self.cone < len(self.cone_bound))).all():
            raise ProofError("cone contains numbers of cones that do not exist.")
        self._check_strength()
        units = np.append(self.obstacle_normals, self.guided[self.guided.any(axis=1)], axis=0)
        if not (np.abs(np.linalg.norm(units, axis=1) - 1) <= 1e-12).all():
            raise ProofError("a normal of an obstacle or a guide is not a unit vector.")
        for name in RUBBING:
            if (fault := fault_of(getattr(self, name))) is not None:
                raise ProofError(f"{name} {fault}.")
        self._check_tags()
        if len(np.unique(self.rigid)) < rigid or not np.isin(self.rigid, self.surface).all():
            raise ProofError("rigid contains a surface twice, or a surface that does not exist.")
        if not self.plastic.any() and (self.is_revolved or not (pairs or k)):
            raise ProofError("no cell can yield, so nothing limits the load.")
        places = self.vertices[self.cells]
        check_cells(places, self.volumes, lambda: self.gradients)
        if self.is_revolved:
            pores = [loads.pore_pressure for loads in kinds.values()]
            check_sections(places, pores, self.rigid_held, loose=self.loose)
        self._check_facets()

    @classmethod
    def of(cls, arrays: Mapping[str, npt.NDArray], known: "Body | None" = None) -> "Body":
        """Return the bodies from arrays by name.

        Args:
            arrays: The arrays.
            known: Bodies to return if the arrays are equal to theirs.

        Raises:
            ProofError: If an array is missing or of another type, or if the arrays do not fit
                together.
        """
        given = with_guided(with_rubbing(with_all(with_rigid(with_kind(arrays)))))
        kinds = {"sought": KINDS[0], "constant": KINDS[1], "others": KINDS[2]}
        fields = [name for name in cls.__dataclass_fields__ if name not in kinds]
        values = checked(given, (*fields, *EVERY))
        loads: dict[str, Any] = {
            kind: Loads(*(values[f"{prefix}{name}"] for name in NAMES))
            for kind, prefix in kinds.items()
        }
        plain: dict[str, Any] = {name: values[name] for name in fields}
        same = known is not None and all(
            equal(getattr(known, name), value) for name, value in plain.items()
        )
        same = same and all(getattr(known, kind).same(of) for kind, of in loads.items())
        return known if known is not None and same else cls(**plain, **loads)

    @property
    def dim(self) -> int:
        """Return the dimension d."""
        return self.vertices.shape[1]

    @property
    def is_revolved(self) -> bool:
        """Return whether the cells are sections of bodies of revolution."""
        return bool(self.revolved)

    @property
    def components(self) -> int:
        """Return the number of components of a stress."""
        return 4 if self.is_revolved else self.dim * (self.dim + 1) // 2

    @property
    def plastic(self) -> Flags:
        """Return flags of the cells that can yield."""
        return self.cone >= 0

    def varies_by(self, number: int) -> str:
        """Return the range of a cone's strength factors in words; an empty text if all are 1."""
        here = self.cell_strength[self.cone == number]
        return f" times {here.min():.6g} to {here.max():.6g}" if (here != 1).any() else ""

    @property
    def loose(self) -> bool:
        """Return whether any cell has a cone with c = 0."""
        return bool((self.cone_bound[self.cone[self.plastic]] == 0).any())

    @cached_property
    def cones(self) -> Cones:
        """Return the cones that bound the stresses."""
        quadratic = self.cone_bound, self.cone_slope, self.cone_matrix
        return Cones(*quadratic, self.cone_sine, self.cone_tension, self.cone_curvature)

    @cached_property
    def yield_radius(self) -> Floats:
        """Return each cell's yield radius (``Cones.radius``), a scale of residuals; ∞ if elastic.

        If the strength varies in a cell, its least value counts.
        """
        weakest = self.cell_strength.min(axis=1)
        return np.asarray(np.append(self.cones.radius, np.inf)[self.cone] * weakest)

    @cached_property
    def steepness(self) -> Floats:
        """Return upper bounds on the cells' dissipation per volume at a unit rate; 0 if elastic."""
        strongest = self.cell_strength.max(axis=1)
        return np.asarray(np.append(self.cones.steepness, 0.0)[self.cone] * strongest)

    @property
    def varies(self) -> bool:
        """Return whether the strength of any cell differs from the strength of its cone."""
        return bool((self.cell_strength != 1).any())

    @cached_property
    def gradients(self) -> Floats:
        """Return the gradients of the barycentric coordinates, shape (num_cells, d + 1, d)."""
        x = self.vertices[self.cells]
        with np.errstate(all="ignore"):
            inner = np.linalg.inv(x[:, 1:] - x[:, :1]).transpose(0, 2, 1)
        return np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)

    @cached_property
    def volumes(self) -> Floats:
        """Return the volumes of the cells."""
        x = self.vertices[self.cells]
        return np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / (2 if self.dim == 2 else 6)

    @cached_property
    def shapes(self) -> Shapes:
        """Return the shapes of the cells, with errors."""
        return shapes_of(self.vertices[self.cells], self.corners)

    @cached_property
    def corners(self) -> Longs:
        """Return the vertex indices of the facet opposite each vertex, shape (d + 1, d)."""
        return np.array([np.delete(np.arange(self.dim + 1), i) for i in range(self.dim + 1)])

    @cached_property
    def sides(self) -> tuple[Longs, Longs]:
        """Return the two sides of each inner facet, and the one side of each outer facet.

        Returns:
            Indices of sides, shapes (num_inner, 2) and (num_outer,). The index of a side is cell ·
            (d + 1) + index of the facet in the cell.

        Raises:
            ProofError: If more than two cells share a facet.
        """
        every = np.sort(self.cells[:, self.corners].reshape(-1, self.dim), axis=1)
        order = np.lexsort(every.T)
        starts = np.flatnonzero(np.diff(every[order], axis=0, prepend=-1).any(axis=1))
        counts = np.diff(starts, append=len(order))
        if counts.max(initial=0) > 2:
            raise ProofError("more than two cells share a facet.")
        inner = starts[counts == 2]
        return np.stack([order[inner], order[inner + 1]], axis=1), order[starts[counts == 1]]

    @cached_property
    def outer(self) -> Longs:
        """Return the index of each facet's side."""
        return self._found[0]

    @cached_property
    def places(self) -> Longs:
        """Return the indices of each facet's vertices in its cell, shape (num_facets, d)."""
        cells = self.cells[self.outer // (self.dim + 1)]
        return np.argmax(cells[:, None] == self.facets[:, :, None], axis=2)

    @cached_property
    def normals(self) -> Floats:
        """Return the unit normals of ``facets``, pointing out of the cells."""
        return self.normals_of(self.outer)

    def normals_of(self, sides: Longs) -> Floats:
        """Return the unit normals of sides, pointing out of their cells."""
        inward = self.gradients.reshape(-1, self.dim)[sides]
        return -inward / np.linalg.norm(inward, axis=1, keepdims=True)

    @property
    def on_axis(self) -> Flags:
        """Return flags of the facets that are on the axis of revolution."""
        return np.asarray(self.is_revolved & ~self.vertices[self.facets][..., 0].any(axis=1))

    @cached_property
    def areas(self) -> Floats:
        """Return the areas of ``facets``."""
        return self.areas_of(self.outer)

    @cached_property
    def widths(self) -> Floats:
        """Return the lengths of ``facets`` in 2D; in 3D their least widths."""
        x = self.vertices[self.facets]
        longest = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1)
        return np.asarray(2 * self.areas / longest if self.dim == 3 else longest)

    def areas_of(self, sides: Longs) -> Floats:
        """Return the areas of sides."""
        slope = np.linalg.norm(self.gradients.reshape(-1, self.dim)[sides], axis=1)
        return np.asarray(self.dim * self.volumes[sides // (self.dim + 1)] * slope)

    def on(self, tag: np.int64) -> Longs:
        """Return the indices of the facets of a surface."""
        return np.flatnonzero(self.surface == tag)

    @cached_property
    def _found(self) -> tuple[Longs, bool]:
        """Return the sides of the stored facets, and whether these are exactly the outer facets."""
        outer = self.sides[1]
        mine = self.cells[:, self.corners].reshape(-1, self.dim)[outer]
        return in_order_of(outer, mine, self.facets)

    def _check_strength(self) -> None:
        """Refuse strength factors that are not positive or that the checker does not support."""
        strength = self.cell_strength
        if not (np.isfinite(strength) & (strength > 0)).all():
            raise ProofError("cell_strength is not positive and finite.")
        if not self.varies:
            return
        steepest = 1e6  # rounding of larger numbers would hide the smaller ones
        if not (strength.max(axis=1) <= steepest * strength.min(axis=1)).all():
            raise ProofError("cell_strength varies by a factor of more than 1e6 in a cell.")
        changed = (strength != 1).any(axis=1)
        fixed = self.cones.is_cut | self.cones.is_curved
        if self.is_revolved or fixed[self.cone[changed & self.plastic]].any():
            raise ProofError(
                "cell_strength is given for bodies of revolution, or for cones with a "
                "tensile strength."
            )
        check_sizes("a strength", self.cones.bound[self.cone, None] * strength)

    def _check_tags(self) -> None:
        """Refuse invalid tags, contacts and obstacles without a surface, and repeated contacts."""
        named = {"contacts": self.contacts, "obstacles": self.obstacles, "rigid": self.rigid}
        if self.surface.size and self.surface.min() < 0:
            raise ProofError("surface has negative tags.")
        for name, tags in named.items():
            if tags.size and tags.min() < 1:
                raise ProofError(f"{name} has a tag that is not positive.")
        for name in ("contacts", "obstacles"):
            if not np.isin(named[name], self.surface).all():
                raise ProofError(f"{name} names a surface that does not exist.")
        if len(np.unique(np.sort(self.contacts, axis=1), axis=0)) < len(self.contacts):
            raise ProofError("contacts contains two surfaces twice.")

    def _check_facets(self) -> None:
        if not self._found[1]:
            raise ProofError("facets are not the outer facets of the cells.")
        one, other = self.sides[0].T
        if not (np.einsum("fi,fi->f", self.normals_of(one), self.normals_of(other)) < 0).all():
            raise ProofError("two cells lie on one side of a facet: cells are folded.")
