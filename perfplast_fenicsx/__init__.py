"""Elastic–perfectly plastic bodies in frictionless contact, and their limit loads."""

from perfplast_fenicsx.assembly import Assembly, read_gmsh
from perfplast_fenicsx.builders import build, l_plate, punch, stacked_blocks, two_blocks
from perfplast_fenicsx.contact import Contact
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.limit_load import LimitLoad, limit_load
from perfplast_fenicsx.loading import load_path, work_path
from perfplast_fenicsx.loads import BodyForce, Pressure, Support, Traction
from perfplast_fenicsx.materials import Elastic, VonMises
from perfplast_fenicsx.newton import Newton
from perfplast_fenicsx.obstacles import Cylinder, Plane, Sphere
from perfplast_fenicsx.options import NewtonOptions
from perfplast_fenicsx.problem import Problem
from perfplast_fenicsx.state import Iteration, Level, LevelReport, State
from perfplast_fenicsx.uzawa import AugmentedLagrangian, AugmentedLagrangianOptions
from perfplast_fenicsx.work_newton import BorderedNewton, WorkNewton

__version__ = "0.1.0"

__all__ = [
    "Assembly",
    "AugmentedLagrangian",
    "AugmentedLagrangianOptions",
    "BodyForce",
    "BorderedNewton",
    "Contact",
    "Cylinder",
    "Elastic",
    "InputError",
    "Iteration",
    "Level",
    "LevelReport",
    "LimitLoad",
    "Newton",
    "NewtonOptions",
    "Plane",
    "Pressure",
    "Problem",
    "Sphere",
    "State",
    "Support",
    "Traction",
    "VonMises",
    "WorkNewton",
    "build",
    "l_plate",
    "limit_load",
    "load_path",
    "punch",
    "read_gmsh",
    "stacked_blocks",
    "two_blocks",
    "work_path",
]
