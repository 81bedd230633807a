"""Define templates of ``[design]`` and ``[[combination]]`` for checks of design codes.

A template lists the factors that a check requires, with their clauses in the code. A factor has a
number if a public source quotes the number with standard and clause. Other factors are open: the
user must fill them in, and the program refuses a case with an open factor.
"""

from collections.abc import Mapping, Sequence

from perfplast_fenicsx.errors import InputError

OPEN = "fill in: "
"""First words of an open factor; the source of its number follows."""

_HEAD = """\
# This is only a template. Replace the names of loads by those of your case. Whoever signs is
# responsible for taking the factors from the edition that applies. For factors that begin with
# "fill in", no public source could be quoted; the program refuses a case until they are filled in.
"""

_TRESCA = """\
# The code uses Tresca's yield condition: law = "tresca" in [material.NAME], with half the yield
# stress as cohesion. This law is not available in plane stress. In this case use von Mises' law.
# With sqrt(3)/2 of the yield stress (strength = 1.1547 times the factor below), von Mises' yield
# set lies inside Tresca's, so a proven lower bound also holds for Tresca's condition. With the full
# yield stress it contains Tresca's set, so a proven upper bound also holds for Tresca's condition.
"""

_EC7 = """\
# Values are those recommended in EN 1997-1:2004, Annex A: actions in Table A.3 (A.3.1; for
# buildings, from EN 1990:2002), soil parameters in Table A.4 (A.3.2), and the resistance of slopes
# in Table A.14 (A.3.3.6), as geotechnicaldesign.info quotes them. National annexes may differ.
# A1: 1.35 permanent, 1.5 variable; A2: 1.0 and 1.3. M1: 1.0; M2: 1.25. R1 and R3: 1.0; R2: 1.1.
# gravity is the load of [gravity], and water that of [water]; remove factors of loads that the case
# does not have. The loads permanent and variable are unfavourable. A favourable variable load has
# the factor 0. With control = "strength", the factor of safety of each combination must be at
# least 1. With control = "bounds" and loads that grow, the bodies must carry the design load.
# 1.25 applies to drained ground (tangent of the angle of shearing resistance, and effective
# cohesion). Undrained shear strength has 1.4 in M2: strength = { clay = 1.4, sand = 1.25 }.
"""

TEMPLATES: Mapping[str, str] = {
    "en-13445-3-gpd": f"""\
# EN 13445-3, Annex B (direct route): design check against global plastic deformation.
{_HEAD}{_TRESCA}
[design]
code = "EN 13445-3, Annex B, global plastic deformation (template)"
strength = "{OPEN}partial safety factor of the resistance, EN 13445-3, Annex B, of this check"

[[combination]]
name = "GPD"

[combination.factors]
pressure = "{OPEN}partial safety factor of the pressure, EN 13445-3, Annex B, of this check"
weight = "{OPEN}partial safety factor of permanent actions, EN 13445-3, Annex B, of this check"
""",
    "asme-viii-2-limit-load": f"""\
# ASME BPVC VIII-2, 5.2.3: limit-load analysis, by von Mises' condition.
{_HEAD}# yield_stress in [material.NAME] is the strength that 5.2.3 prescribes for this analysis, so
# [design] has no factor on strength. Add one [[combination]] for each further row of the table,
# with live load, wind, earthquake and snow.

[design]
code = "ASME BPVC VIII-2, 5.2.3, Table 5.4 (template)"

[[combination]]
name = "Table 5.4, design conditions"

[combination.factors]
pressure = "{OPEN}factor of P, ASME VIII-2, Table 5.4, design conditions, global"
head = "{OPEN}factor of Ps (static head), ASME VIII-2, Table 5.4, design conditions, global"
weight = "{OPEN}factor of D (dead weight), ASME VIII-2, Table 5.4, design conditions, global"
""",
    "en-1993-1-14": f"""\
# EN 1993-1-14: resistance by a materially nonlinear analysis (MNA), von Mises' condition.
{_HEAD}# 1.35 and 1.5 are the recommended values of EN 1990:2002, Table A1.2(B), expression (6.10);
# favourable permanent actions have 1.0. "Steel Buildings in Europe", part 10, Table 2.1, quotes
# 1.35, 1.5 and gamma_M0 = 1.0 with their standards, without clauses. National annexes may
# differ.

[design]
code = "EN 1993-1-14, with EN 1990:2002, Table A1.2(B) (template)"
strength = "{OPEN}gamma_M0 (EN 1993-1-1:2005, 6.1(1): 1.0) times the model factor of EN 1993-1-14"

[[combination]]
name = "1.35 G + 1.5 Q"
factors = {{ permanent = 1.35, variable = 1.5 }}

[[combination]]
name = "1.0 G + 1.5 Q"
factors = {{ permanent = 1.0, variable = 1.5 }}
""",
    "en-1997-1-da1": f"""\
# EN 1997-1, 2.4.7.3.4.2: Design Approach 1, GEO: A1 + M1 + R1, and A2 + M2 + R1.
{_HEAD}{_EC7}
[design]
code = "EN 1997-1:2004, 2.4.7.3.4.2, Design Approach 1, Annex A (template)"

[[combination]]
name = "DA1-1 (A1 + M1 + R1)"
factors = {{ gravity = 1.35, water = 1.35, permanent = 1.35, variable = 1.5 }}

[[combination]]
name = "DA1-2 (A2 + M2 + R1)"
factors = {{ gravity = 1.0, water = 1.0, permanent = 1.0, variable = 1.3 }}
strength = 1.25
""",
    "en-1997-1-da2": f"""\
# EN 1997-1, 2.4.7.3.4.3: Design Approach 2, GEO: A1 + M1 + R2, for slopes.
{_HEAD}{_EC7}# R2 = 1.1 divides the strength of the ground, which is the resistance of a slope.
# Footings and walls have other values of R2 (Tables A.5 and A.13), which divide their resistance.

[design]
code = "EN 1997-1:2004, 2.4.7.3.4.3, Design Approach 2, Annex A (template)"

[[combination]]
name = "DA2 (A1 + M1 + R2)"
factors = {{ gravity = 1.35, water = 1.35, permanent = 1.35, variable = 1.5 }}
strength = 1.1
""",
    "en-1997-1-da3": f"""\
# EN 1997-1, 2.4.7.3.4.4: Design Approach 3, GEO: A1 or A2 + M2 + R3.
{_HEAD}{_EC7}# Here permanent and variable are actions from structures (A1).
# Actions on the ground, such as traffic on a slope, have the factors 1.0 and 1.3 (A2).

[design]
code = "EN 1997-1:2004, 2.4.7.3.4.4, Design Approach 3, Annex A (template)"

[[combination]]
name = "DA3 (A1 or A2 + M2 + R3)"
factors = {{ gravity = 1.0, water = 1.0, permanent = 1.35, variable = 1.5 }}
strength = 1.25
""",
}
"""The templates by name, as TOML that users copy into a case."""


def check_filled_in(table: Mapping[str, object], place: str) -> None:
    """Raise an error for a factor that a template left open.

    Args:
        table: Table of a case.
        place: Place in the input, for messages.

    Raises:
        InputError: If a value begins with :data:`OPEN`.
    """
    for key, value in table.items():
        if isinstance(value, Mapping):
            check_filled_in(value, f"{place}, {key}")
        elif isinstance(value, str) and value.startswith(OPEN.strip()):
            where = value.removeprefix(OPEN.strip()).strip() or "the number is missing"
            raise InputError(
                f"{place}: {key} is not filled in ({where}); give a number from the applicable "
                "edition of the code."
            )


def templates_in_words(names: Sequence[str] = tuple(TEMPLATES)) -> str:
    """Return the names of the templates as text, with the first line of each template."""
    width = max(map(len, names))
    return "\n".join(f"{name:{width}}  {TEMPLATES[name].splitlines()[0][2:]}" for name in names)
