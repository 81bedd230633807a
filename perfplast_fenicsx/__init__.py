"""Elastic–perfectly plastic bodies in frictionless contact, and their limit loads."""

from perfplast_fenicsx.assembly import Assembly, read_gmsh
from perfplast_fenicsx.builders import build, l_plate, punch, stacked_blocks, two_blocks
from perfplast_fenicsx.contact import Contact
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.loading import load_path
from perfplast_fenicsx.loads import BodyForce, Pressure, Support, Traction
from perfplast_fenicsx.materials import Elastic, VonMises
from perfplast_fenicsx.newton import Newton, NewtonOptions
from perfplast_fenicsx.problem import Problem
from perfplast_fenicsx.state import Iteration, Level, LevelReport, State

__version__ = "0.1.0"

__all__ = [
    "Assembly",
    "BodyForce",
    "Contact",
    "Elastic",
    "InputError",
    "Iteration",
    "Level",
    "LevelReport",
    "Newton",
    "NewtonOptions",
    "Pressure",
    "Problem",
    "State",
    "Support",
    "Traction",
    "VonMises",
    "build",
    "l_plate",
    "load_path",
    "punch",
    "read_gmsh",
    "stacked_blocks",
    "two_blocks",
]
