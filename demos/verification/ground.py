# %% [markdown]
# # Ground with friction: tubes and spheres of Drucker–Prager material
#
# In plane strain, the Drucker–Prager cone with `match = "plane-strain"` has the same limit loads as
# associated Mohr–Coulomb ground with cohesion c and friction angle φ. A thick tube under inner
# pressure p, with a constant outer pressure q, is plastic everywhere at
#
#     p = (q + c cot φ)(b/a)^m − c cot φ,    m = 2 sin φ/(1 + sin φ)
#
# If q compresses the tube while p decreases, the whole tube is plastic at p = (q + c cot φ)(a/b)^n
# − c cot φ with n = 2 sin φ/(1 − sin φ). This p may be negative, which is a tension.
#
# In a thick sphere σ_θ = σ_φ > σ_r, so the material yields on the meridian of triaxial compression,
# and
#
#     p = (c/η)((b/a)^k − 1),    k = 6η/(√3 + 2η)
#
# with the slope η and the strength c of the cone, for any `match`; with `match = "compression"`
# this is the Mohr–Coulomb value (c cot φ)((b/a)^m' − 1), m' = 4 sin φ/(1 + sin φ). Elastic
# constants have no effect on limit loads. Plastic flow increases the volume, so elements do not
# lock: linear elements converge too.
#
# A smooth strip footing on weightless ground carries the pressure N_c c, where N_c = (e^(π tan φ) N
# − 1) cot φ with N = (1 + sin φ)/(1 − sin φ) (L. Prandtl, Nachr. Ges. Wiss. Göttingen (1920), 74).
#
# A block in 3D between smooth plates carries the pressure 2c √N, on any mesh, if the cone matches
# triaxial compression.
#
#     ./fenicsx mpirun -n 2 python3 demos/verification/ground.py

# %%
import math
from collections.abc import Sequence

from mpi4py import MPI

from demos.verification.study import Row, collapse, mesh, run
from meshes.strip_footing import write_strip_footing
from meshes.thick_tube import write_thick_tube
from perfplast_fenicsx import (
    Contact,
    DruckerPrager,
    Pressure,
    Problem,
    Support,
    TaggedMesh,
    stacked_blocks,
)
from perfplast_fenicsx.io import ResultFolder, Scene
from perfplast_fenicsx.pictures import draw

TITLE = "Ground with friction"
COHESION, OUTER, SEAM = 10.0, 2.0, 1.4
SURCHARGE = 20.0
ALLOWED = 2e-3
SUPPORTS = [Support("x0", "x"), Support("y0", "y")]
CONTACTS = [Contact("inner_tube_seam", "outer_tube_seam")]


def ground(angle: float, match: str = "plane-strain") -> DruckerPrager:
    """Return ground with a friction angle (degrees)."""
    return DruckerPrager(1e5, 0.3, COHESION, angle, match)  # type: ignore[arg-type]


def tube_limit(angle: float, outside: float = 0.0, falling: bool = False) -> float:
    """Return the inner pressure at which the tube is plastic everywhere."""
    s, tip = math.sin(math.radians(angle)), COHESION / math.tan(math.radians(angle))
    power = -2 * s / (1 - s) if falling else 2 * s / (1 + s)
    return float((outside + tip) * OUTER**power - tip)


def sphere_limit(angle: float, match: str) -> float:
    """Return the inner pressure at which the sphere is plastic everywhere."""
    slope, strength = ground(angle, match).cone
    power = 6 * slope / (math.sqrt(3) + 2 * slope)
    return float(strength / slope * (OUTER**power - 1))


def footing_limit(angle: float) -> float:
    """Return the limit pressure of a strip footing on weightless ground."""
    phi = math.radians(angle)
    grows = math.exp(math.pi * math.tan(phi)) * (1 + math.sin(phi)) / (1 - math.sin(phi))
    return COHESION * (grows - 1) / math.tan(phi)


def block_limit(angle: float) -> float:
    """Return the limit pressure of a block between smooth plates with free sides."""
    s = math.sin(math.radians(angle))
    return 2 * COHESION * math.sqrt((1 + s) / (1 - s))


# %% [markdown]
# ## Tubes
#
# With a constant outer pressure, the demo finds the limit load for either sign of the inner
# pressure.


# %%
def shell(
    tagged_mesh: TaggedMesh,
    angle: float,
    loads: Sequence[Pressure],
    degree: int = 2,
    match: str = "plane-strain",
) -> Problem:
    """Return a quarter of a tube, or half a section of a sphere."""
    divided = len(tagged_mesh.volumes) > 1
    return Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, ground(angle, match)),
        SUPPORTS[1:] if tagged_mesh.axisymmetric else SUPPORTS,
        list(loads),
        CONTACTS if divided else [],
        degree=degree,
    )


def tubes(folder: ResultFolder, sizes: Sequence[float]) -> list[Row]:
    """Return limit loads for undivided and divided tubes, without and with outer pressure.

    Collective.
    """
    rows = []
    live, outside = Pressure("inner", 1.0), Pressure("outer", SURCHARGE, constant=True)
    for angle in (10.0, 20.0, 30.0, 40.0):
        for seam, degree in ((None, 1), (None, 2), (SEAM, 2)):
            case = f"tube{', divided' if seam else ''}, φ {angle:g}°"
            for size in sizes:
                tagged_mesh = mesh(
                    folder, write_thick_tube, outer=OUTER, interface=seam, size=size, order=degree
                )
                problem = shell(tagged_mesh, angle, [live], degree)
                allowed = ALLOWED if degree == 2 else None
                found = collapse(problem, method="path")
                rows.append(found.row(case, size, tube_limit(angle), allowed))
        tagged_mesh = mesh(folder, write_thick_tube, outer=OUTER, size=sizes[-1], order=2)
        signs = (1.0, -1.0) if angle > 10 else ()  # at 10° q alone causes collapse
        for sign in signs:
            problem = shell(tagged_mesh, angle, [Pressure("inner", sign), outside])
            found = collapse(problem, method="path")
            exact = sign * tube_limit(angle, SURCHARGE, falling=sign < 0)
            case = f"tube, q, φ {angle:g}°, {'rising' if sign > 0 else 'falling'}"
            rows.append(found.row(case, sizes[-1], exact, ALLOWED))
    return rows


# %% [markdown]
# ## Spheres, as half of a section, and blocks


# %%
def spheres(folder: ResultFolder, sizes: Sequence[float]) -> list[Row]:
    """Return limit loads of spheres, with cones fitted in two ways. Collective."""
    rows = []
    for match in ("compression", "plane-strain"):
        for angle in (10.0, 40.0):
            for size in sizes:
                tagged_mesh = mesh(folder, write_thick_tube, outer=OUTER, size=size, order=2)
                loads = [Pressure("inner", 1.0)]
                problem = shell(tagged_mesh.turned(), angle, loads, match=match)
                found = collapse(problem, method="path")
                case = f"sphere, {match}, φ {angle:g}°"
                rows.append(found.row(case, size, sphere_limit(angle, match), ALLOWED))
    return rows


FOOTINGS = {10.0: (6.0, 3.0), 20.0: (9.0, 4.0), 30.0: (16.0, 7.0)}
"""Width and depth of the ground by friction angle, large enough that its sides have no effect."""


def footings(folder: ResultFolder, sizes: Sequence[float]) -> list[Row]:
    """Return limit pressures of strip footings by the interior point method. Collective."""
    rows = []
    for angle, (width, depth) in FOOTINGS.items():
        for size in sizes:
            tagged_mesh = mesh(
                folder, write_strip_footing, width=width, depth=depth, grading=20.0, size=size
            )
            problem = Problem(
                tagged_mesh,
                {"ground": ground(angle)},
                [Support("x0", "x"), Support("side", "x"), Support("bottom")],
                [Pressure("footing", 1.0)],
                degree=2,
            )
            found = collapse(problem)
            rows.append(found.row(f"footing, φ {angle:g}°", size, footing_limit(angle), 0.015))
    return rows


def blocks(comm: MPI.Intracomm) -> list[Row]:
    """Return limit loads of two stacked cubes in contact with free sides. Collective."""
    tagged_mesh = stacked_blocks(comm, n=1)
    problem = Problem(
        tagged_mesh,
        dict.fromkeys(tagged_mesh.volumes, ground(25.0, "compression")),
        [Support("x0", "x"), Support("y0", "y"), Support("bottom", "z")],
        [Pressure("top", 1.0)],
        [Contact("upper_bottom", "lower_top")],
    )
    return [collapse(problem, method="path").row("cubes, φ 25°", 1.0, block_limit(25.0), 1e-4)]


# %%
def study(comm: MPI.Intracomm, folder: ResultFolder, coarse: bool) -> list[Row]:
    """Return limit loads of tubes, spheres and blocks. Collective."""
    sizes = (0.1,) if coarse else (0.3, 0.15, 0.075)
    rows = [*tubes(folder, sizes), *spheres(folder, sizes), *blocks(comm)]
    rows += footings(folder, (0.5,) if coarse else (0.5, 0.25, 0.12))
    loads = [Pressure("inner", 1.0)]
    tagged_mesh = mesh(folder, write_thick_tube, outer=OUTER, size=sizes[-1], order=2)
    found = collapse(shell(tagged_mesh, 30.0, loads), method="path")
    found.write(folder, Scene(TITLE, loads, []))
    draw(folder)
    return rows


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all cases, print the table, and check its numbers. Collective."""
    run(TITLE, study, argv)


# %%
if __name__ == "__main__":
    main()
