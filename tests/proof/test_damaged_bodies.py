"""Test that the checker refuses bodies with damaged meshes for any claimed stress.

The stress is a uniform pressure along the last axis. It is in equilibrium in any cell, and in the
valid mesh, so only the mesh can be wrong.
"""

from mpi4py import MPI

import numpy as np
import pytest

from perfplast_fenicsx.proof import ProofError
from perfplast_fenicsx.proof.checker import check_lower
from tests.mesh.damaged_meshes import DAMAGED, NAMES, Plain, blocks, inverted
from tests.proof.forging import Arrays

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="the checker is serial")

HARMLESS = {("not glued", 2), ("not glued", 3), ("a few not glued", 2), ("a few not glued", 3)}
"""Cuts along the pressure. A stress that a cut body carries is also a stress of the whole body, so
the lower bound holds for both. The run refuses these meshes, and the checker names the cuts."""


def pressed(mesh: Plain) -> Arrays:
    """Return the lower half of a proof on a mesh, with the load 1 and the yield radius 1."""
    d, cells = mesh.dim, mesh.cells
    m = d * (d + 1) // 2
    every = np.concatenate([np.delete(cells, i, axis=1) for i in range(d + 1)])
    _, first, counts = np.unique(
        np.sort(every, axis=1), axis=0, return_index=True, return_counts=True
    )
    facets = every[first[counts == 1]]
    named = {tuple(sorted(f)): tag for f, tag in zip(mesh.facets, mesh.tags, strict=True)}
    surface = np.array([named.get(tuple(sorted(f)), 0) for f in facets])
    stress = np.zeros((len(cells), d + 1, d, d))
    stress[..., -1, -1] = -1.0
    traction = np.zeros((len(facets), d, d))
    traction[surface == NAMES["high"], :, -1] = -1.0
    return {
        "vertices": mesh.points,
        "cells": cells,
        "cone": np.zeros(len(cells), dtype=int),
        "cone_bound": np.ones(1),
        "cone_slope": np.zeros((1, m)),
        "cone_matrix": np.eye(m)[None],
        "cone_sine": np.full(1, np.nan),
        "body_force": np.zeros((len(cells), d)),
        "facets": facets,
        "surface": surface,
        "held": np.repeat(surface[:, None] == NAMES["low"], d, axis=1),
        "traction": traction,
        "rigid": np.zeros(0, dtype=int),
        "rigid_held": np.zeros((0, d), dtype=bool),
        "contacts": np.array([[NAMES["seam_a"], NAMES["seam_b"]]]),
        "contact_adhesion": np.zeros(1),
        "contact_friction": np.zeros(1),
        "obstacles": np.zeros(0, dtype=int),
        "obstacle_normals": np.zeros((0, d)),
        "obstacle_adhesion": np.zeros(0),
        "obstacle_friction": np.zeros(0),
        "stress": stress,
        "bound": np.array(1.0),
    }


def said_of(mesh: Plain) -> str:
    """Return the faults of the half; empty for a proof."""
    try:
        return "; ".join(check_lower(pressed(mesh)).faults)
    except ProofError as error:
        return str(error)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_sound_body_is_proven(dim: int) -> None:
    """The checker proves it for either orientation of the cells."""
    assert said_of(blocks(dim)) == ""
    assert said_of(inverted(blocks(dim))) == ""
    assert "cut open" not in str(check_lower(pressed(blocks(dim))).words)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_bodies_are_refused(name: str, dim: int) -> None:
    mesh = DAMAGED[name][0](dim)
    said = said_of(mesh)
    assert (said == "") == ((name, dim) in HARMLESS), said
    if not said:
        (told,) = (word for word in check_lower(pressed(mesh)).words if word.startswith("Taken"))
        assert "cuts between" in told
