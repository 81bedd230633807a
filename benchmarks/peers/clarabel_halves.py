"""Compare the program with Clarabel on the conic programs for both bounds of two blocks.

./fenicsx python3 -m pip install --target DIR clarabel==0.11.1
./fenicsx env PYTHONPATH=DIR python3 -m benchmarks.peers.clarabel_halves 3

Both solve to a tolerance of 1e-4 on one core. The processor time of the program includes set-up and
certificate of a bound; a first run compiles the forms. The processor time of Clarabel includes only
the solution of the conic program. In 3D, Clarabel does not solve the program for the lower bound
with its default regularisation, so the script sets a larger regularisation.
"""

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

from mpi4py import MPI

import clarabel
import h5py
import numpy as np

from demos.two_blocks import blocks
from perfplast_fenicsx.io import ResultFolder
from perfplast_fenicsx.io.results.proof_file import write_proof
from perfplast_fenicsx.limit_analysis import limit_bounds
from perfplast_fenicsx.limit_analysis.body.limit_bounds import admitted, mechanism_bound
from perfplast_fenicsx.limit_analysis.body.proof_arrays import proofs
from perfplast_fenicsx.limit_analysis.stress.static_bound import form_that_fits, strict_lower_bound
from perfplast_fenicsx.proof.body import Body
from tests.proof.conic_oracle import Floats, Rows, best_load, least_power, posed

RTOL = 1e-4


def main() -> None:
    """Compute both bounds by the program and by Clarabel, and print values and times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("n", type=int, help="cubes per unit length")
    problem = admitted(blocks(MPI.COMM_WORLD, parser.parse_args().n), RTOL)
    for name in ("first", "here"):
        began = time.process_time()
        found, *_ = mechanism_bound(problem, RTOL, None)
        upper = time.process_time() - began
        form = form_that_fits(problem)
        stress = strict_lower_bound(problem, RTOL, None, found.question, form)
        lower = time.process_time() - began - upper
        print(f"{name}: upper {found.mesh.estimate:.6g}, {upper:.2f} s", end="; ")
        print(f"lower {stress.bound.value:.6g}, {lower:.2f} s", flush=True)
    folder = ResultFolder(MPI.COMM_WORLD, Path(tempfile.mkdtemp()))
    bounds = limit_bounds(problem, RTOL)
    write_proof(folder, folder.file("bounds.h5"), *proofs(bounds, bounds))
    with h5py.File(folder.file("bounds.h5")) as file:
        both = {half: Body.of({key: it[()] for key, it in file[half].items()}) for half in file}
        nodes = file["upper"]["nodes"][()]
    inside = (5 - 5**0.5) / 20
    points = np.full((4, 4), inside) + (1 - 4 * inside) * np.eye(4)
    print(f"Clarabel, {len(both['upper'].cells)} parts: upper", end=" ", flush=True)
    least_power(both["upper"], nodes, points, by=solve)
    print("Clarabel: lower", end=" ", flush=True)
    best_load(both["lower"], by=solve)


def solve(
    cost: Floats, equal: tuple[Any, Floats], least: Any, cones: Rows, right: Floats
) -> float | None:
    """Solve a conic program by Clarabel, print its processor time, and return the optimum.

    Arguments are those of ``posed`` in ``tests/proof/conic_oracle.py``.
    """
    problem = posed(cost, equal, least, cones, right)
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_rel, settings.tol_gap_abs = RTOL, 1e-12
    settings.dynamic_regularization_delta = 1e-5
    began = time.process_time()
    solution = clarabel.DefaultSolver(*problem, settings).solve()
    took = time.process_time() - began
    print(f"{solution.status}, {solution.obj_val:.6g}, {took:.2f} s", flush=True)
    return float(solution.obj_val)


if __name__ == "__main__":
    main()
