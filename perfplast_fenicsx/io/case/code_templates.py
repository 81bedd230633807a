"""Store templates of ``[design]`` and ``[[combination]]`` by names of codes, with open values.

A template lists the factors that a check requires and their clauses in the code. It contains a
number if a public source gives it with standard and clause. Other values are open, and the program
refuses a case with an open value.
"""

from collections.abc import Mapping, Sequence

from perfplast_fenicsx.errors import InputError

OPEN = "fill in: "
"""First words of a value without a number in the template; its source follows."""

_HEAD = """\
# A template, and no more: names of loads are those of the case, and whoever signs takes the
# factors from the edition that applies. What begins with "fill in" has no public source that this
# program could quote; a case that still has it is refused.
"""

_TRESCA = """\
# The code goes by Tresca's yield condition: law = "tresca" in [material.NAME], with half of the
# yield stress as cohesion. Sheets in plane stress do not have it: there von Mises' condition with
# sqrt(3)/2 of the yield stress lies inside of Tresca's, so that what is carried for certain with
# the factor below times 1.1547 is carried by Tresca's condition too, and a collapse with the factor
# itself is one by Tresca's.
"""

_EC7 = """\
# Values are those recommended by EN 1997-1:2004, Annex A: actions by Table A.3 (A.3.1; for
# buildings, of EN 1990:2002), soil parameters by Table A.4 (A.3.2), the resistance of slopes by
# Table A.14 (A.3.3.6), as geotechnicaldesign.info quotes them. National annexes may have others.
# A1: 1.35 permanent, 1.5 variable; A2: 1.0 and 1.3. M1: 1.0; M2: 1.25. R1 and R3: 1.0; R2: 1.1.
# gravity is the weight, water that of [water]; leave out what the case has not. Loads called
# permanent and variable are unfavourable ones. A variable load that is favourable has the factor 0.
# With control = "strength" the factor of safety of each combination has to be 1 or more. With
# control = "bounds" and loads that grow, their design load has to be carried.
# 1.25 is for drained ground (the tangent of the angle of shearing resistance, and the effective
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
{_HEAD}# yield_stress of [material.NAME] is the strength that 5.2.3 prescribes for this analysis, so
# that [design] divides by nothing. Further rows of the table, with live load, wind, earthquake and
# snow, are further [[combination]]s.

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
{_HEAD}# 1.35 and 1.5: recommended values of EN 1990:2002, Table A1.2(B), expression (6.10); 1.0
# where permanent actions are favourable. "Steel Buildings in Europe", part 10, Table 2.1, quotes
# 1.35, 1.5 and gamma_M0 = 1.0 with their standards, without clauses. National annexes may have
# others.

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
{_HEAD}{_EC7}# R2: 1.1 divides the strength of the ground, which is the resistance of a slope.
# Footings and walls have other values of R2 (Tables A.5 and A.13), which divide what they carry.

[design]
code = "EN 1997-1:2004, 2.4.7.3.4.3, Design Approach 2, Annex A (template)"

[[combination]]
name = "DA2 (A1 + M1 + R2)"
factors = {{ gravity = 1.35, water = 1.35, permanent = 1.35, variable = 1.5 }}
strength = 1.1
""",
    "en-1997-1-da3": f"""\
# EN 1997-1, 2.4.7.3.4.4: Design Approach 3, GEO: A1 or A2 + M2 + R3.
{_HEAD}{_EC7}# permanent and variable come from structures here (A1); those on the ground, such as
# traffic on a slope, have 1.0 and 1.3 (A2).

[design]
code = "EN 1997-1:2004, 2.4.7.3.4.4, Design Approach 3, Annex A (template)"

[[combination]]
name = "DA3 (A1 or A2 + M2 + R3)"
factors = {{ gravity = 1.0, water = 1.0, permanent = 1.35, variable = 1.5 }}
strength = 1.25
""",
}
"""Templates by name, as TOML to be copied into a case."""


def check_filled_in(table: Mapping[str, object], place: str) -> None:
    """Refuse values that a template left open.

    Args:
        table: Table of a case.
        place: Place in the input, which messages name.

    Raises:
        InputError: If a value begins with :data:`OPEN`.
    """
    for key, value in table.items():
        if isinstance(value, Mapping):
            check_filled_in(value, f"{place}, {key}")
        elif isinstance(value, str) and value.startswith(OPEN.strip()):
            where = value.removeprefix(OPEN.strip()).strip() or "the number is missing"
            raise InputError(
                f"{place}: {key} must still be filled in ({where}); give a number from the "
                "edition of the code that applies."
            )


def templates_in_words(names: Sequence[str] = tuple(TEMPLATES)) -> str:
    """Return the names of templates with the first line of each."""
    width = max(map(len, names))
    return "\n".join(f"{name:{width}}  {TEMPLATES[name].splitlines()[0][2:]}" for name in names)
