# %% [markdown]
# # 200 random fields of strength in one slope
#
# The slope consists of clay without friction, is 5 m high with an inclination of 2:1, and lies on 5
# m of the same clay (`cases/random_slope.toml`). The cohesion is log-normal, with a mean of 25 kPa
# and a coefficient of variation of 0.5. The correlation of its logarithm decreases with the
# distance d as exp(−2d/θ), θ = 10 m (D. V. Griffiths, G. A. Fenton, J. Geotech. Geoenviron. Eng.
# 130 (2004), 507). Field k has the seed k. The random values are generated at the vertices of the
# first mesh and are linear between the vertices, so both bounds use the exact field. Because the
# ground has no friction, the limit factor of the weight is the factor of safety.
#
# Field k is in `field_k.vtu`, and the proof of its bounds is in `field_k/bounds.h5`. `fields.csv`
# has a row for each field; the demo does not solve a field again that has a row.
#
#     ./fenicsx python3 demos/verification/random_fields.py

# %%
import argparse
import csv
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from perfplast_fenicsx import Adaptation, adaptive_bounds
from perfplast_fenicsx.io import Case, ResultFolder, ResultWriter, read_case
from perfplast_fenicsx.materials import Tresca
from perfplast_fenicsx.problem import Prescribed
from perfplast_fenicsx.proof import check

CASE = Path(__file__).parent / "cases" / "random_slope.toml"
FIELDS, MEAN, VARIATION, LENGTH = 200, 25.0, 0.5, 10.0
WIDTH = 2.0
"""Largest mean width of brackets (percent)."""
COHESION = "cohesion = 25.0"
COLUMNS = ("seed", "lower", "upper", "cells", "seconds", "mean_cohesion")


# %% [markdown]
# ## A field


# %%
def square_root(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return a matrix that maps independent normal numbers to the logarithm of the field."""
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    variance = np.log(1 + VARIATION**2)
    return np.asarray(np.linalg.cholesky(variance * np.exp(-2 * apart / LENGTH)))


def field(root: npt.NDArray[np.float64], seed: int) -> npt.NDArray[np.float64]:
    """Return the log-normal values of a field at the points."""
    normal = np.random.default_rng(seed).standard_normal(len(root))
    return np.asarray(MEAN / np.sqrt(1 + VARIATION**2) * np.exp(root @ normal))


def write_field(
    path: Path,
    points: npt.NDArray[np.float64],
    cells: npt.NDArray[np.int64],
    values: npt.NDArray[np.float64],
) -> None:
    """Write values at the vertices of triangles as a .vtu file, in text."""

    def array(kind: str, name: str, numbers: npt.NDArray[Any]) -> str:
        text = " ".join(map(repr, numbers.ravel().tolist()))
        return f'<DataArray type="{kind}" Name="{name}" format="ascii">{text}</DataArray>\n'

    count = f'NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}"'
    space = array("Float64", "Points", np.pad(points, ((0, 0), (0, 1))))
    space = space.replace("format", 'NumberOfComponents="3" format')
    lines = [
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian">\n',
        f"<UnstructuredGrid><Piece {count}>\n<Points>{space}</Points>\n<Cells>",
        array("Int64", "connectivity", cells),
        array("Int64", "offsets", 3 * np.arange(1, len(cells) + 1)),
        array("UInt8", "types", np.full(len(cells), 5)),
        f"</Cells>\n<PointData>{array('Float64', 'c', values)}</PointData>\n",
        "</Piece></UnstructuredGrid></VTKFile>\n",
    ]
    path.write_text("".join(lines), encoding="utf-8")


# %% [markdown]
# ## Bounds for a field


# %%
def solve(folder: Path, seed: int, coarse: bool) -> dict[str, str]:
    """Bound the factor of safety of a field, check the proof, and return the row of the field."""
    began = time.process_time()
    name = f"field_{seed:03d}"
    points, cells = first_mesh(read_case(write_case(folder, COHESION)))
    values = field(square_root(points), seed)
    write_field(folder / f"{name}.vtu", points, cells, values)
    case = read_case(write_case(folder, of_file(seed)))
    adaptation = Adaptation(0.3, 600) if coarse else case.adapt
    bounds = adaptive_bounds(case.problem(MPI.COMM_WORLD), adaptation)
    assert bounds.lower.strict and bounds.upper.strict, (bounds.lower.why_not, bounds.upper.why_not)
    results = ResultFolder(MPI.COMM_WORLD, folder / name, force=True)
    results.create()
    best = bounds.best
    writer = ResultWriter(
        results, best.problem, case.scene, "interior-point", prescribed=Prescribed.WORK
    )
    writer.write_limit(best.mesh, bounds.body, bounds, fields=False)
    halves = check(results.file("bounds.h5"))
    assert set(halves) == {"lower", "upper"}
    assert not any(half.faults for half in halves.values()), halves
    low, high = bounds.lower.value, bounds.upper.value
    assert low is not None and high is not None and low <= high
    count = bounds.high.problem.tagged_mesh.mesh.topology.index_map(2).size_global
    seconds = time.process_time() - began
    row = (seed, low, high, count, round(seconds, 1), values.mean())
    return dict(zip(COLUMNS, map(repr, map(float, row)), strict=True))


def first_mesh(case: Case) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return the vertices and triangles of the mesh of a case."""
    geometry = case.tagged_mesh(MPI.COMM_SELF).mesh.geometry
    return geometry.x[:, :2].astype(np.float64), geometry.dofmap.astype(np.int64)


def of_file(seed: int) -> str:
    """Return the line of the case that names the file of a field."""
    return f'cohesion = {{ file = "field_{seed:03d}.vtu", column = "c" }}'


def write_case(folder: Path, cohesion: str) -> Path:
    """Write the case with a cohesion, and return its path; the folder also stores the mesh."""
    text = CASE.read_text(encoding="utf-8")
    assert COHESION in text
    (folder / CASE.name).write_text(text.replace(COHESION, cohesion), encoding="utf-8")
    return folder / CASE.name


def known(path: Path) -> dict[int, dict[str, str]]:
    """Return the rows of solved fields, by seed."""
    if not path.is_file():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        return {int(float(row["seed"])): row for row in csv.DictReader(file)}


# %% [markdown]
# ## All fields


# %%
def draw(rows: Sequence[dict[str, str]], picture: Path) -> None:
    """Draw the cumulative distributions of both bounds."""
    low, high = (np.sort([float(row[side]) for row in rows]) for side in ("lower", "upper"))
    figure = Figure(figsize=(9, 4), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    bars, curve = figure.subplots(1, 2)
    bins = np.linspace(low[0], high[-1], 25).tolist()
    bars.hist(low, bins=bins, color="#0b5cad", alpha=0.6, label="lower bounds")
    bars.hist(high, bins=bins, color="#b5541c", alpha=0.6, label="upper bounds")
    bars.set(xlabel="factor of safety", ylabel="fields")
    bars.legend()
    share = np.arange(1, len(rows) + 1) / len(rows)
    curve.fill_betweenx(share, low, high, step="mid", color="#b5541c", alpha=0.5)
    curve.step(low, share, color="#0b5cad", where="mid", linewidth=1.0)
    curve.axvline(1.0, color="black", linewidth=0.8, linestyle="--")
    curve.set(xlabel="factor of safety", ylabel="share of fields that are not above it")
    figure.suptitle(f"{len(rows)} log-normal fields of one slope, each between strict bounds")
    figure.savefig(picture)


def draw_field(folder: Path, row: dict[str, str], picture: Path) -> None:
    """Draw the strength of a field."""
    case = read_case(write_case(folder, of_file(int(float(row["seed"])))))
    clay = case.materials["clay"]
    assert isinstance(clay, Tresca)
    points, cells = first_mesh(case)
    figure = Figure(figsize=(9, 3.6), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    mesh = Triangulation(points[:, 0], points[:, 1], cells)
    drawn = axes.tripcolor(mesh, clay.cohesion.at(points, "clay"), shading="gouraud", cmap="YlOrBr")
    figure.colorbar(drawn, ax=axes, label="cohesion (kPa)")
    axes.set_aspect("equal")
    sides = f"{float(row['lower']):.3f} … {float(row['upper']):.3f}"
    axes.set_title(f"seed {int(float(row['seed']))}: factor of safety {sides}")
    figure.savefig(picture)


def main(argv: Sequence[str] | None = None) -> None:
    """Solve all fields that have no row, and check the widths of their brackets."""
    parser = argparse.ArgumentParser(description="200 random fields of one slope.")
    parser.add_argument("-o", "--output", type=Path, default=Path("results/random_fields"))
    parser.add_argument("--coarse", action="store_true", help="two fields on coarse meshes")
    arguments = parser.parse_args(argv)
    folder, coarse = arguments.output, arguments.coarse
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "fields.csv"
    rows = known(table)
    for seed in range(2 if coarse else FIELDS):
        if seed in rows:
            continue
        rows[seed] = solve(folder, seed, coarse)
        with table.open("a", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            if file.tell() == 0:
                writer.writeheader()
            writer.writerow(rows[seed])
        print(" ".join(f"{name} {float(value):.5g}" for name, value in rows[seed].items()))
    found = list(rows.values())
    low, high = (np.array([float(row[side]) for row in found]) for side in ("lower", "upper"))
    assert (low <= high).all()
    widths = 100 * (high / low - 1)
    print(f"{len(found)} fields, each with its proof; widths in %: mean {widths.mean():.2f}, most")
    print(
        f"{widths.max():.2f}. Below 1 for certain: {(high < 1).sum()}, perhaps: {(low < 1).sum()}."
    )
    draw(found, folder / "random_fields.png")
    draw_field(folder, found[int(np.argmin(low))], folder / "weakest_field.png")
    print(f"Pictures are in {folder}.")
    assert coarse or widths.mean() <= WIDTH


# %%
if __name__ == "__main__":
    main()
