"""The first case file of a geometry: all that is known of it, and what is left to say."""

import json

from perfplast_fenicsx.geometry.survey import Body, Face, Joint, Survey
from perfplast_fenicsx.materials.common import TABLE, Common

HEAD = """\
# What is marked with <- is to be filled in; `perfplast check` says what is still missing.

title = {title}

[mesh]
file = {mesh}
"""

HINT = """
# Materials: `perfplast materials` has numbers of common ones.
"""

MATERIAL = """
[material.{body}]
law = "von-mises"               # or "elastic", without yield_stress
young = {young}
poisson = {poisson}
yield_stress = {yield_stress}
"""

CONTACT = """
[[{kind}]]                     # {shapes}, {area:.4g} of area{other}
primary = {primary}
secondary = {secondary}
"""

LOADS = """
[[support]]                     # what holds the bodies, once or more
on = "NAME"                     # <- one of the faces below
components = {components}

[[load]]                        # what pushes and pulls, once or more
on = "NAME"                     # <-
traction = {traction}     # <- or pressure = 1.0

[element]
degree = 2

[loading]
control = "work"
until = "limit"                 # at what load the bodies collapse

[units]
system = {system}             # or "m-kN-kPa", "SI", ...: what the numbers are in

"""


def first_case(
    survey: Survey, title: str, mesh: str, material: Common | None = None, tied: bool = False
) -> str:
    """A case file with all bodies and joints; materials, supports and loads are to be filled in.

    Args:
        survey: What there is.
        title: Of the case.
        mesh: Path of the mesh, relative to that of the case file.
        material: Of all bodies; left to be filled in where it is missing.
        tied: Glue what touches, and leave nothing in frictionless contact.
    """
    zero = [0.0] * survey.dim
    text = HEAD.format(title=_quoted(title), mesh=_quoted(mesh))
    text += HINT
    text += "".join(_material(body, material) for body in survey.bodies)
    text += "".join(_joint(joint, tied) for joint in survey.joints)
    text += LOADS.format(
        components=_quoted("xyz"[: survey.dim]),
        traction=[*zero[1:], -1.0],
        system=_quoted(TABLE),
    )
    text += "# Free faces, with their areas and places:\n"
    return text + "".join(_face(face) for face in survey.faces)


def _material(body: Body, material: Common | None) -> str:
    numbers = (material.young, material.poisson, material.yield_stress) if material else ()
    shown = [f"{number}" for number in numbers] or [f"{0.0:<28}# <-"] * 3
    young, poisson, yield_stress = shown
    return MATERIAL.format(body=body.name, young=young, poisson=poisson, yield_stress=yield_stress)


def _joint(joint: Joint, tied: bool) -> str:
    return CONTACT.format(
        kind="tie" if tied else "contact",
        shapes=" and ".join(joint.shapes),
        area=joint.area,
        other="" if tied else "; [[tie]] glues instead",
        primary=_quoted(joint.surfaces[0]),
        secondary=_quoted(joint.surfaces[1]),
    )


def _face(face: Face) -> str:
    place = ", ".join(f"{x:.5g}" for x in face.centre)
    return f"#   {face.name:32} {face.shape}, {face.area:.5g}, about ({place})\n"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")  # TOML wants that too
