"""Write ``bounds.h5``: proofs of bounds of a limit load, which can be checked without the program.

The groups ``lower`` and ``upper`` contain the arrays of :mod:`proof_arrays`, and
:mod:`proof.checker` checks them.
"""

from pathlib import Path

import h5py

from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.parallel_hdf5 import write_arrays
from perfplast_fenicsx.io.results.result_folder import ResultFolder
from perfplast_fenicsx.limit_analysis.body.adaptive_meshes import AdaptiveBounds
from perfplast_fenicsx.limit_analysis.body.body_bounds import BodyBounds
from perfplast_fenicsx.limit_analysis.body.proof_arrays import (
    LowerProof,
    VelocityProof,
    half_arrays,
    proofs,
)
from perfplast_fenicsx.limit_analysis.body.proven_bounds import proven_part
from perfplast_fenicsx.proof.checker import check
from perfplast_fenicsx.proof.verdict import Checked


def write_proof(
    folder: ResultFolder, path: Path, lower: LowerProof | None, upper: VelocityProof | None
) -> None:
    """Write the proofs of bounds. Collective.

    Args:
        folder: Result folder, which provides the ranks and the message for system errors.
        path: The file; its folder exists.
        lower: The lower half, if there is one.
        upper: The upper half; its bodies may be meshed differently.

    Raises:
        InputError: If cells or obstacles are curved, if the file format does not support the kind
            of a load, or if the system refuses.
    """
    blocks, numbers = half_arrays(lower, upper)

    def describe(file: h5py.File) -> None:
        for kind, each in numbers.items():
            file.create_group(kind).attrs.update(each)

    every = {f"{kind}/{name}": of for kind, half in blocks.items() for name, of in half.items()}
    write_arrays(folder, path, every, describe=describe)


def save_proof(bounds: BodyBounds | AdaptiveBounds, path: str | Path) -> dict[str, Checked]:
    """Write the proof of bounds, and have the checker prove it again from the file. Collective.

    Args:
        bounds: As :func:`~.limit_bounds` or :func:`~.adaptive_bounds` has returned them.
        path: The file, such as ``bounds.h5``; it is replaced.

    Returns:
        By "lower" and "upper" what the checker proves, on every rank; without a half that has no
        strict bound or that the checker refuses.

    Raises:
        InputError: On every rank, if the bounds have no proof, or the file cannot be written.
    """
    both = (bounds.low, bounds.high) if isinstance(bounds, AdaptiveBounds) else (bounds, bounds)
    target, comm = Path(path), both[0].problem.comm
    folder = ResultFolder(comm, target.parent, force=True)
    folder.on_root(lambda: target.parent.mkdir(parents=True, exist_ok=True))
    low, high = judge(folder, folder.file(target.name), *both)
    if not (low.lower.strict or high.upper.strict):
        why = "; ".join((*low.lower.why_not, *high.upper.why_not))
        raise InputError(f"these bounds have no proof ({why}); use strict ones.")
    found: dict[str, Checked] = comm.bcast(check(target) if comm.rank == 0 else {})
    return found


def judge(
    folder: ResultFolder,
    path: Path,
    low: BodyBounds,
    high: BodyBounds,
    divisor: float | None = None,
) -> tuple[BodyBounds, BodyBounds]:
    """Write the proof of two bounds, and check it with the checker. Collective.

    Args:
        folder: The result folder.
        path: The file. It contains only proven results, and does not exist if nothing is proven.
        low: Result with the lower bound.
        high: Result with the upper bound.
        divisor: F that divides the strengths of the bodies; None without such a factor.

    Returns:
        Both results; bounds that the checker refuses are replaced by estimates of the mesh. If the
        checker proves only a weaker bound, the result has this bound.

    Raises:
        InputError: As :func:`write_proof`.
    """

    def ask(lower: LowerProof | None, upper: VelocityProof | None) -> dict[str, Checked]:
        write_proof(folder, path, lower, upper)
        return check(path) if folder.comm.rank == 0 else {}

    low, high = proven_part(low, high, ask, divisor)
    if proofs(low, high) == (None, None):
        folder.on_root(lambda: path.unlink(missing_ok=True))
    return low, high
