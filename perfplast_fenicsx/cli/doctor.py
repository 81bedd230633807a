"""Implement ``perfplast doctor``: test everything that a run needs, and print a line for each test.

Tests of components that may crash or hang run in separate processes.
"""

import json
import os
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

from perfplast_fenicsx import environment
from perfplast_fenicsx._version import __version__
from perfplast_fenicsx.cli.json_answer import Answer
from perfplast_fenicsx.cli.launch import find_launcher
from perfplast_fenicsx.environment import environment_apart, environment_with_package

SOUND, FAULTY = 0, 2
"""Exit statuses."""

PATIENCE = 180.0
"""Longest time for a test (s)."""

SLOW = 2e9
"""Speed of one core, in floating-point operations per second, below which its BLAS is the slow
reference BLAS."""

SCARCE = 1e9
"""Memory without which no useful case can be solved (bytes)."""

ORDERINGS = {0: "AMD", 2: "AMF", 3: "Scotch", 4: "PORD", 5: "METIS", 6: "QAMD"}
"""Names of the orderings by MUMPS's number, which is INFOG(7) in its users' guide."""

LINKED = "libgl1 libglu1-mesa libxrender1 libxcursor1 libxft2 libxinerama1"
"""Debian packages with the libraries to which gmsh from PyPI is linked."""


@dataclass(frozen=True)
class Finding:
    """The result of one test of ``perfplast doctor``.

    Attributes:
        verdict: "ok", "none" for an optional component that is not installed, or "FAULT".
        text: The result in words, or the fault with its remedy.
    """

    verdict: str
    text: str


def doctor(answer: Answer) -> int:
    """Print a line for each test, and return the exit status. Not collective.

    Args:
        answer: The JSON answer, to which this function adds the tests.

    Returns:
        0 if everything that is installed works; otherwise 2.
    """
    print(
        f"perfplast {__version__}, Python {sys.version.split()[0]} ({sys.executable})", flush=True
    )
    findings = []
    tests = answer.fields["tests"] = []
    for name, trial in TRIALS.items():
        finding = trial()
        findings.append(finding)
        tests.append({"name": name} | asdict(finding))
        print(f"{name:<14}  {finding.verdict:<5}  {finding.text}", flush=True)
    faults = sum(finding.verdict == "FAULT" for finding in findings)
    print(
        f"{faults} {'fault' if faults == 1 else 'faults'} found." if faults else "All tests passed."
    )
    return FAULTY if faults else SOUND


def compiler() -> Finding:
    """Return the result of the test for a C compiler that can compile a Python module."""
    fault = environment.compiler_fault()
    if fault is not None:
        return Finding("FAULT", fault)
    name = environment.c_compiler()
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "a.c"
        source.write_text("#include <Python.h>\n#include <math.h>\n", encoding="utf-8")
        include = ["-I", sysconfig.get_path("include")]
        command = [name, "-fsyntax-only", *include, str(source)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        return Finding(
            "FAULT",
            f"{name} fails ({lines[0]}); install the C headers (Debian: libc6-dev python3-dev).",
        )
    return Finding("ok", name)


def cache() -> Finding:
    """Return the result of the test for a folder that can store compiled forms."""
    fault = environment.forms_fault()
    ours = fault is not None and fault != environment.compiler_fault()
    return Finding("FAULT", str(fault)) if ours else Finding("ok", str(environment.forms_folder()))


def libraries() -> Finding:
    """Return the versions of the solver's libraries, or the reason why they cannot be loaded."""
    fault = environment.surroundings().fault()
    if fault is not None:
        return Finding("FAULT", fault)
    found = _apart("solving")
    if found.verdict == "FAULT" and environment.compiler_fault() is not None:
        return Finding("FAULT", "no form can be compiled; see the line of the C compiler.")
    return found


def launcher() -> Finding:
    """Return the result of starting two MPI ranks."""
    try:
        found = find_launcher()
    except (LookupError, subprocess.TimeoutExpired) as error:
        return Finding("FAULT", str(error))
    # Only rank 0 prints the number of ranks, because launchers may mix the output of two ranks.
    # If the two processes are not connected, both have rank 0, and both print "1".
    question = (
        "from mpi4py import MPI; world = MPI.COMM_WORLD; ranks = world.allreduce(1); "
        "world.rank or print(ranks)"
    )
    own = dict(os.environ)  # includes the variables that launchers need
    done = _run([found.program, "-n", "2", sys.executable, "-c", question], own)
    if done is None:
        return Finding("FAULT", f"{found} did not start two ranks within {PATIENCE:g} s.")
    if done.stdout.split() != ["2"]:
        lines = [line for line in done.stderr.splitlines() if line.strip("-= ")]
        reason = lines[0].strip() if lines else f"the ranks printed {done.stdout.split()}"
        if found.family == "Open MPI" and os.getuid() == 0:
            allow = "OMPI_ALLOW_RUN_AS_ROOT"
            reason += f"; as root set {allow}=1 and {allow}_CONFIRM=1"
        return Finding("FAULT", f"{found} does not start two ranks: {reason}.")
    return Finding("ok", f"started two ranks with {found}")


def memory() -> Finding:
    """Return the amount of available memory; the verdict is FAULT if it is too small for a run."""
    lines = Path("/proc/meminfo").read_text(encoding="utf-8").splitlines()
    kilobytes = {line.split(":")[0]: float(line.split()[1]) for line in lines}
    free, whole = (1024 * kilobytes[name] for name in ("MemAvailable", "MemTotal"))
    text = f"{free / 1e9:.1f} of {whole / 1e9:.1f} GB are free"
    if free < SCARCE:
        return Finding("FAULT", f"{text}, but a run needs {SCARCE / 1e9:g} GB; end other programs.")
    return Finding("ok", text)


def factors() -> Finding:
    """Return the ordering that MUMPS chooses, and the speed of a factorisation."""
    return _apart("factorising")


def meshes() -> Finding:
    """Return the result of meshing a box with gmsh."""
    return _apart("meshing")


def pictures() -> Finding:
    """Return the result of drawing a picture."""
    return _apart("drawing")


def _solving() -> Finding:
    """Compile and assemble a form, and return the versions or the fault."""
    from mpi4py import MPI
    from petsc4py import PETSc

    import dolfinx
    import numpy as np
    import ufl
    from dolfinx import fem, mesh

    if np.issubdtype(PETSc.ScalarType, np.complexfloating):
        return Finding("FAULT", "PETSc uses complex numbers; install a PETSc with real numbers.")
    square = mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    area = fem.assemble_scalar(fem.form(1.0 * ufl.dx(domain=square)))
    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    vendor, version = MPI.get_vendor()
    found = f"{dolfinx.__version__}, PETSc {petsc}, {vendor} {'.'.join(map(str, version))}"
    if abs(area - 1.0) > 1e-12:
        return Finding(
            "FAULT", f"DOLFINx {found} computes the area of the unit square as {area:g}."
        )
    return Finding("ok", f"{found}, NumPy {np.__version__}")


def _factorising() -> Finding:
    """Return the speed of factorising the mass matrix of 29³ hexahedra with MUMPS on one core."""
    from mpi4py import MPI
    from petsc4py import PETSc

    import scipy.sparse as sparse

    if not PETSc.Sys.hasExternalPackage("mumps"):
        return Finding("FAULT", "PETSc has no MUMPS; install DOLFINx from PyPI, Debian or conda.")
    line = sparse.diags_array([1.0, 4.0, 1.0], offsets=[-1, 0, 1], shape=(30, 30))
    cube = sparse.csr_array(sparse.kron(line, sparse.kron(line, line)))
    indices = (cube.indptr.astype(PETSc.IntType), cube.indices.astype(PETSc.IntType))
    matrix = PETSc.Mat().createAIJ(cube.shape, csr=(*indices, cube.data), comm=MPI.COMM_SELF)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    factor = PETSc.PC().create(MPI.COMM_SELF)
    factor.setType(PETSc.PC.Type.CHOLESKY)
    factor.setFactorSolverType("mumps")
    factor.setOperators(matrix)
    begin = time.process_time()
    factor.setUp()
    seconds = time.process_time() - begin
    factors = factor.getFactorMatrix()
    ordering = ORDERINGS.get(factors.getMumpsInfog(7), "an unknown ordering")
    speed = factors.getMumpsRinfog(3) / seconds
    text = (
        f"MUMPS, ordering {ordering}: {cube.shape[0]} unknowns in {seconds:.1f} s on one "
        f"core, {speed / 1e9:.1f} GFLOP/s"
    )
    if speed < SLOW:
        remedy = "install OpenBLAS (Debian's package libopenblas0-pthread)"
        return Finding("FAULT", f"{text}, which is slow; {remedy}.")
    return Finding("ok", text)


def _meshing() -> Finding:
    """Mesh a box with gmsh, and return the version or the fault."""
    try:
        import gmsh
    except ModuleNotFoundError:
        return Finding("none", "gmsh is not installed; use pip install gmsh to mesh CAD files.")
    except OSError as error:
        return Finding("FAULT", f"gmsh: {error}; apt-get install {LINKED}.")
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addBox(0.0, 0.0, 0.0, 1.0, 1.0, 1.0)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(3)
    gmsh.finalize()
    return Finding("ok", f"gmsh {metadata.version('gmsh')} meshed a box")


def _drawing() -> Finding:
    """Draw a box as the drawing process does, with its own X server if Xvfb is installed."""
    versions = {name: environment.version_of(name) for name in ("pyvista", "matplotlib")}
    missing = [name for name, version in versions.items() if version is None]
    if missing:
        text = (
            f"{' and '.join(missing)} not installed; use pip install pyvista matplotlib "
            "for pictures."
        )
        return Finding("none", text)
    from perfplast_fenicsx.pictures.drawing_process import display

    drawn = (
        "import pyvista; p = pyvista.Plotter(off_screen=True, window_size=[40, 40])\n"
        "p.add_mesh(pyvista.Cube(), color='black')\n"
        "assert p.screenshot(return_img=True).min() < 100\n"
        "print(type(p.render_window).__name__)"
    )
    with display() as variables:
        done = _run([sys.executable, "-P", "-c", drawn], variables)
    if done is None or done.returncode:
        return Finding(
            "FAULT",
            f"pyvista {versions['pyvista']} cannot draw; install Debian's libosmesa6, libegl1 or"
            " xvfb, or set pictures = false in [output].",
        )
    return Finding("ok", f"pyvista {versions['pyvista']} drew a box ({done.stdout.split()[-1]})")


TRIALS: dict[str, Callable[[], Finding]] = {
    "C compiler": compiler,
    "compiled forms": cache,
    "DOLFINx": libraries,
    "MPI": launcher,
    "factorisation": factors,
    "memory": memory,
    "gmsh": meshes,
    "pictures": pictures,
}
"""The tests by the names that their lines show. The C compiler comes first, because forms need
it."""

APART: dict[str, Callable[[], Finding]] = {
    "solving": _solving,
    "factorising": _factorising,
    "meshing": _meshing,
    "drawing": _drawing,
}
"""Tests that may crash, by the argument that runs them in a separate process."""


def _apart(trial: str) -> Finding:
    """Return the result of a test from :data:`APART`, which runs in a separate process."""
    program = [sys.executable, "-P", "-m", "perfplast_fenicsx.cli.doctor", trial]
    done = _run(program)
    if done is None:
        return Finding("FAULT", f"{trial} did not end within {PATIENCE:g} s.")
    try:
        return Finding(**json.loads(done.stdout.splitlines()[-1]))
    except (IndexError, ValueError, TypeError):
        lines = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        return Finding("FAULT", f"{trial} ended with: {lines[-1].strip()}")


def _run(
    command: list[str], variables: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str] | None:
    """Run a command, and return its result; None if it does not end within :data:`PATIENCE`."""
    variables = environment_with_package(environment_apart() if variables is None else variables)
    try:
        return subprocess.run(
            command, env=variables, capture_output=True, text=True, timeout=PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        return None


if __name__ == "__main__":
    print(json.dumps(asdict(APART[sys.argv[1]]())))
