"""Write a first case file for a geometry, with its known data and entries to fill in."""

import json
import re
from collections.abc import Iterator, Mapping
from enum import Enum

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.geometry.meshing_options import MeshingOptions, symmetry_name
from perfplast_fenicsx.geometry.survey import Body, Face, Joint, NamedFaces, Survey
from perfplast_fenicsx.materials.common import TABLE, Common

ADAPTED = {2: 20_000, 3: 9_000}
"""Largest number of cells, by dimension, with which the case also adapts the mesh. Adaptation takes
three to five times as long as one mesh."""

AFFORDABLE = {2: 60_000, 3: 30_000}
"""Largest number of cells, by dimension, with which a first case computes bounds. The bounds
take some minutes on one core."""

IN_CONTACT = 2 / 3
"""Factor on ``ADAPTED`` and ``AFFORDABLE`` for bodies in contact, which take longer."""


BOUNDS = """\
[loading]
control = "bounds"              # proven lower and upper bounds on the limit load
"""

ADAPT = """\
limit_tolerance = 5e-3          # relative accuracy of each bound on one mesh

[mesh]                          # refined until the gap is {percent:.0f} %, or up to so many cells
adapt = {{ until = {until}, cells = {cells} }}
"""

ONE_MESH = """\
# on this mesh only, because {why}
"""

ESTIMATE = """\
[loading]
control = "work"                # not control = "bounds", because {why}
until = "limit"                 # limit load of the mesh: an estimate, which may be too high
"""


def loading_for(survey: Survey, options: MeshingOptions) -> str:
    """Return ``[loading]`` and ``[mesh]`` of a first case, with the reason if there are no bounds.

    Args:
        survey: Survey of bodies, joints and faces. In a first case, all bodies have the same law,
            which can yield, and all loads grow.
        options: Meshing options.
    """
    why = next(_against(survey, options), None)
    if why is not None:
        return ESTIMATE.format(why=why)
    why = next(_against_adapting(survey), None)
    if why is not None:
        return BOUNDS + ONE_MESH.format(why=why)
    growth = 2.0  # largest number of cells of the last mesh, relative to the first mesh
    cells = round(growth * _most(survey, ADAPTED))
    until = 0.1  # relative distance between the bounds at which the refinement ends
    return BOUNDS + ADAPT.format(percent=100 * until, until=until, cells=cells)


def _against(survey: Survey, options: MeshingOptions) -> Iterator[str]:
    """Yield the reasons why bounds are not possible or take long."""
    if survey.joints and options.meshed == "apart" and survey.dim == 3:
        yield "in 3D, bounds need matching nodes of the bodies, but each body is meshed separately"
    if survey.degree > 1:
        yield "bounds are not available for curved elements (order = 2)"
    if (cells := _cells(survey)) > affordable_cells(survey):
        yield f"bounds take long with {cells} elements (a larger size gives fewer elements)"


def _against_adapting(survey: Survey) -> Iterator[str]:
    """Yield the reason why bounds are computed on one mesh only."""
    if _cells(survey) > _most(survey, ADAPTED):
        yield f"meshes finer than {_cells(survey)} elements take long; see adapt under [mesh]"


def affordable_cells(survey: Survey) -> int:
    """Return the largest number of cells for which a first case of these bodies computes bounds."""
    return int(_most(survey, AFFORDABLE))


def _most(survey: Survey, cells: Mapping[int, int]) -> float:
    return cells[survey.dim] * (IN_CONTACT if survey.joints else 1.0)


def _cells(survey: Survey) -> int:
    return sum(body.cells for body in survey.bodies)


BOLT = re.compile(r"bolt|screw|stud|schraube|vis(_|$)|boulon|tornillo|vite(_|$)|sroub")
NUTS = "nut|mutter|ecrou|tuerca|dado|matice|matka"
NUT = re.compile(f"(^|_){NUTS}")
"""Patterns of names of bolts and nuts in several languages."""

NUT_ALONE = re.compile(rf"^((hex|lock|jam|cap|wing|flange|sechskant)_?)?({NUTS})(_?m?\d+)*$")
PIN = re.compile(r"(^|_)(pin|dowel|stift|goupille|pipe)(_|$)")
"""Names that are those of a nut as a whole, such as nut_1, and names of bodies without a thread."""


class Glued(Enum):
    """The joints that are glued in a first case."""

    SHARED = 0  # joints of bodies that share faces in the drawing
    BOLTS = 1  # also threads with their nuts
    ALL = 2
    NOTHING = 3

    def glues(self, joint: Joint) -> bool:
        """Return whether a joint becomes a tie, not a contact."""
        bolted = self is Glued.BOLTS and is_thread(joint)
        return self is Glued.ALL or bolted or (joint.shared and self is not Glued.NOTHING)


def is_thread(joint: Joint) -> bool:
    """Return whether a nut is screwed on the other body of a joint.

    The names of the bodies decide: the other body is a bolt, or the bore of the joint belongs to a
    body whose whole name is that of a nut. The body in the bore may then have any name but that of
    a pin or pipe.
    """
    around_any = NUT_ALONE.search(joint.bore) and not any(map(PIN.search, joint.bodies))
    return are_bolt_and_nut(*joint.bodies) or bool(around_any)


def are_bolt_and_nut(one: str, other: str) -> bool:
    """Return whether names of two bodies, or of their surfaces, are those of a bolt and a nut."""
    return any(BOLT.search(a) and NUT.search(b) for a, b in ((one, other), (other, one)))


HEAD = """\
# Fill in the entries marked with <-; `perfplast check` reports entries that are missing.

title = {title}

[geometry]                      # meshed again if this table or the file has changed
file = {file}
{size}{others}"""

SUPPORTS = """
[[support]]                     # plane of symmetry
on = {name}
components = {axis}
"""

HINT = """
# `perfplast materials` lists the parameters of common materials.
"""

MATERIAL = """
[material.{body}]
law = "von-mises"               # or "elastic", without yield_stress
young = {young}
poisson = {poisson}
yield_stress = {yield_stress}
"""

CONTACT = """
[[{kind}]]                     # {shapes}, area {area:.4g}{other}
primary = {primary}
secondary = {secondary}
{formulation}"""

NEAR = """
# {one} and {other} are {gap:.3g} apart and do not touch. If they should touch, give
# close_gaps = {above:.2g} under [geometry] (perfplast mesh --close-gaps), or a
# [[contact]] with a face of each as primary and secondary, and formulation = "mortar"
"""

LOADS = """
[[support]]                     # one or more supports
on = "NAME"                     # <- one of the faces below
components = {components}

[[load]]                        # one or more loads
on = "NAME"                     # <-
traction = {traction}     # <- or pressure = 1.0

[element]
degree = 2

{loading}
[units]
system = {system}             # units of the numbers; or "m-kN-kPa", "SI", ...

"""


def first_case(
    survey: Survey,
    title: str,
    file: str,
    options: MeshingOptions | None = None,
    material: Common | None = None,
    glued: Glued = Glued.SHARED,
) -> str:
    """Return a case file with bodies and joints, and with supports and loads to fill in.

    Args:
        survey: Survey of bodies, joints and faces.
        title: Title of the case.
        file: Path of the geometry file, relative to the folder of the case file.
        options: Meshing options.
        material: Material of all bodies; with None, the user must enter the materials.
        glued: Which joints are glued; the others are frictionless contacts.

    Raises:
        InputError: If bolts are to be glued to nuts, but no bolt touches a nut.
    """
    options = options or MeshingOptions()
    if glued is Glued.BOLTS and not any(is_thread(joint) for joint in survey.joints):
        raise InputError(
            "no body named as a bolt touches a body named as a nut, and no body lies in the bore "
            "of a nut; give them names such as bolt_1 and nut_1 in the CAD system, or omit "
            "--bolted and write [[tie]] in the case."
        )
    zero = [0.0] * survey.dim
    text = HEAD.format(
        title=_quoted(title),
        file=_quoted(file),
        size=f"{'# ' if options.size is None else ''}size = {survey.size:.4g}\n",
        others=_others(options),
    )
    text += HINT
    text += "".join(_material(body, material) for body in survey.bodies)
    text += "".join(_joint(joint, glued, options) for joint in survey.joints)
    for near in survey.near:
        one, other = near.bodies
        text += NEAR.format(one=one, other=other, gap=near.gap, above=1.1 * near.gap)
    for axis in options.symmetry:
        text += SUPPORTS.format(name=_quoted(symmetry_name(axis)), axis=_quoted(axis))
    text += LOADS.format(
        components=_quoted("xyz"[: survey.dim]),
        traction=[*zero[1:], -1.0],
        loading=loading_for(survey, options),
        system=_quoted(TABLE),
    )
    text += "# Free faces, with their areas and centres:\n"
    text += "".join(_face(face) for face in survey.faces)
    if survey.sets:
        text += "# Names that cover several free faces ([[geometry.face]] defines further names):\n"
    return text + "".join(_set(one) for one in survey.sets)


def _material(body: Body, material: Common | None) -> str:
    numbers = (material.young, material.poisson, material.yield_stress) if material else ()
    # 0.0 would be a valid Poisson's ratio, and nan is not
    shown = [f"{it}" for it in numbers] or [f"{it:<28}# <-" for it in ("0.0", "nan", "0.0")]
    young, poisson, yield_stress = shown
    return MATERIAL.format(body=body.name, young=young, poisson=poisson, yield_stress=yield_stress)


def _others(options: MeshingOptions) -> str:
    """Return lines for the options, except the size, that differ from the defaults."""
    usual, text = MeshingOptions(), ""
    keys = ("sizes", "curvature", "order", "meshed", "shared", "symmetry", "overlap")
    for key in (*keys, "close_gaps", "without"):
        value = getattr(options, key)
        if value == getattr(usual, key):
            continue
        if isinstance(value, dict):
            inside = ", ".join(f"{name} = {float(number)}" for name, number in value.items())
            text += f"{key} = {{{inside}}}\n"
        else:
            text += f"{key} = {_quoted(value) if isinstance(value, str | list) else value}\n"
    return text


def _joint(joint: Joint, glued: Glued, options: MeshingOptions) -> str:
    bolt, tied = is_thread(joint), glued.glues(joint)
    if tied and joint.shared and glued is not Glued.ALL:
        bolt, why = False, "; the drawing has one face for both; write [[contact]] to separate them"
    else:
        why = ""
    other = (
        ("; a thread with its nut: write [[tie]] to glue them")
        if bolt
        else "; write [[tie]] to glue them"
    )
    return CONTACT.format(
        kind="tie" if tied else "contact",
        shapes=" and ".join(joint.shapes),
        area=joint.area,
        other=why if tied else other,
        primary=_quoted(joint.surfaces[0]),
        secondary=_quoted(joint.surfaces[1]),
        formulation="" if tied or options.meshed == "together" else 'formulation = "mortar"\n',
    )


def _face(face: Face) -> str:
    place = ", ".join(f"{x:.5g}" for x in face.centre)
    shape = f"{face.shape} ({face.round_of})" if face.round_of else face.shape
    return f"#   {face.name:32} {shape}, {face.area:.5g}, centre ({place})\n"


def _set(one: NamedFaces) -> str:
    faces = f"{len(one.faces)} faces, " if one.faces else ""
    return f"#   {one.name:32} {one.why}; {faces}area {one.area:.5g}\n"


def _quoted(text: str | list[str]) -> str:
    # TOML requires this escape too
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
