"""The groups of jobs that ``make bench`` runs, one group after the other."""

from dataclasses import dataclass, field

CASE = ("-m", "benchmarks.case")
LIMIT = ("-m", "benchmarks.limit")
TERMS = ("-m", "benchmarks.terms")

REFERENCES = {
    ("l_plate", 2): 111.49381284,
    ("l_plate", 4): 144.04255883,
    ("l_plate", 8): 170.88487971,
    ("punch", 8): 5.7498083896e-4,
    ("punch", 16): 5.8728525143e-4,
    ("punch", 32): 5.9190717408e-4,
}
"""α of the last level with linear elements, by model and n, from GetFEM and from Octave."""


@dataclass(frozen=True)
class Job:
    """A command that runs in its own processes and writes a JSON record.

    Attributes:
        name: Name of the job in its group.
        command: Arguments of ``python3``, without the output file.
        ranks: Number of MPI ranks; 0 if the command itself starts MPI.
        peer: Python module or program that must be installed, or "" if none is needed.
        reference: α of the last level; None if it is not known.
    """

    name: str
    command: tuple[str, ...]
    ranks: int = 1
    peer: str = ""
    reference: float | None = None


@dataclass(frozen=True)
class Group:
    """Jobs that are compared with each other; each round runs every job once.

    Attributes:
        about: Description, which the terminal shows.
        jobs: The jobs, in the order of a round.
        rounds: Default number of rounds.
    """

    about: str
    jobs: tuple[Job, ...] = field(default=())
    rounds: int = 3


def case(
    model: str, n: int, *options: str, ranks: int = 1, solver: str = "default", name: str = ""
) -> Job:
    """Return a job in which this program solves a load path.

    Args:
        model: Name in ``MODELS``.
        n: Cubes per unit length.
        options: Further arguments of ``benchmarks.case``.
        ranks: Number of MPI ranks.
        solver: Name of the linear solver in ``benchmarks.case``.
        name: Name of the job; by default ranks and solver.
    """
    label = name or f"{plural(ranks)}, {solver} solver"
    command = (*CASE, model, "--n", str(n), "--solver", solver, *options)
    return Job(label, command, ranks, reference=REFERENCES.get((model, n)))


def one_level(n: int) -> tuple[Job, ...]:
    """Return jobs that solve one level of the bolted assembly by factors and by Total FETI."""
    options = ("--degree", "2", "--levels", "0.5", "--units", "0")
    return (
        case("bolted", n, *options, ranks=2, solver="direct"),
        case("bolted", n, *options, "--contact-solver", "tfeti", ranks=2, name="2 ranks, T-FETI"),
    )


def limit(model: str, n: int, *options: str, ranks: int) -> Job:
    """Return a job in which this program computes a limit load."""
    return Job(f"limit load, {plural(ranks)}", (*LIMIT, model, "--n", str(n), *options), ranks)


def plural(ranks: int) -> str:
    """Return the number of ranks with its noun, such as "2 ranks"."""
    return f"{ranks} rank{'s' if ranks > 1 else ''}"


def getfem(n: int) -> Job:
    """Return a job in which GetFEM solves the punch."""
    command = ("benchmarks/peers/getfem_punch.py", "--n", str(n))
    return Job("GetFEM", command, peer="getfem", reference=REFERENCES.get(("punch", n)))


def plain(n: int, ranks: int, factor: str) -> Job:
    """Return a job in which a plain DOLFINx loop solves the plate; ``factor`` is LU or Cholesky."""
    command = ("-m", "benchmarks.peers.plain_newton", "--n", str(n), "--factor", factor)
    name = f"plain UFL, MUMPS {factor}, {plural(ranks)}"
    return Job(name, command, ranks, reference=REFERENCES.get(("l_plate", n)))


def step42(ranks: int, refinements: int = 5) -> Job:
    """Return a job that runs deal.II's step-42 with perfect plasticity."""
    command = ("-m", "benchmarks.peers.step42", "--ranks", str(ranks))
    name = f"deal.II step-42, {plural(ranks)}"
    return Job(name, (*command, "--refinements", str(refinements)), 0, peer="step-42")


def calculix(name: str, stiffer: int) -> Job:
    """Return a job that compares CalculiX with this program; ``stiffer`` multiplies the modulus."""
    command = ("-m", "benchmarks.peers.calculix", name, "--stiffer", str(stiffer))
    return Job(f"{name}, {stiffer} E, both", command, 0, peer="calculix")


def plate(n: int) -> tuple[Job, ...]:
    """Return jobs for the plate on 1 and 2 ranks, by this program and by plain DOLFINx loops."""
    return tuple(
        job
        for ranks in (1, 2)
        for job in (
            case("l_plate", n, ranks=ranks),
            plain(n, ranks, "lu"),
            plain(n, ranks, "cholesky"),
        )
    )


WORKS = ("--works", "0.016", "0.025", "0.066")
"""Works of `two_blocks` with n = 8 at ζ = 60, 80, 100; finer meshes use the same works."""

GROUPS = {
    "start": Group(
        "import to first Newton step, compiled forms in the cache",
        (case("two_blocks", 4, "--cold", "--units", "0", name="1 rank"),),
    ),
    "two_blocks_8": Group(
        "two blocks, 12 150 unknowns",
        (
            case("two_blocks", 8, solver="multigrid"),
            case("two_blocks", 8),
        ),
    ),
    "two_blocks_16": Group(
        "two blocks, 84 966 unknowns",
        (
            case("two_blocks", 16, solver="multigrid"),
            case("two_blocks", 16, solver="multigrid", ranks=2),
        ),
    ),
    "two_blocks_24": Group(
        "two blocks, 273 750 unknowns",
        (
            case("two_blocks", 24, solver="multigrid"),
            case("two_blocks", 24, solver="multigrid", ranks=2),
        ),
    ),
    "two_blocks_38": Group(
        "two blocks, 1 049 490 unknowns",
        (case("two_blocks", 38, solver="multigrid", ranks=2),),
        rounds=1,
    ),
    "growth": Group(
        "two blocks at the same works of the loads: iterations, not times",
        (
            case("two_blocks", 8, *WORKS, solver="multigrid", name="n = 8"),
            case("two_blocks", 16, *WORKS, solver="multigrid", ranks=2, name="n = 16"),
            case("two_blocks", 38, *WORKS, solver="multigrid", ranks=2, name="n = 38"),
        ),
        rounds=1,
    ),
    "punch_16": Group("punch, 16 926 unknowns", (case("punch", 16), getfem(16))),
    "punch_32": Group("punch, 122 550 unknowns", (case("punch", 32), getfem(32))),
    "punch_64": Group("punch, 931 686 unknowns", (case("punch", 64, ranks=2),), rounds=1),
    "l_plate_4": Group("plate, level 2, 19 215 unknowns", plate(4)),
    "l_plate_8": Group("plate, level 3, 133 947 unknowns", plate(8)),
    "terms": Group(
        "a level with constant load, given motion and history beside one without, 19 215 unknowns",
        (Job("1 rank", (*TERMS, "--n", "2", "--degree", "2")),),
    ),
    "p2_contact": Group(
        "two blocks, quadratic elements, 84 966 unknowns",
        (
            case("two_blocks", 8, "--degree", "2", "--levels", "50", "60", "70"),
            case("two_blocks", 8, "--degree", "2", "--levels", "50", "60", "70", ranks=2),
        ),
    ),
    "bolted_40k": Group(
        "a bolted assembly of ten bodies, quadratic elements, 41 979 unknowns",
        (
            case("bolted", 2, "--degree", "2", solver="multigrid"),
            case("bolted", 2, "--degree", "2", solver="multigrid", ranks=2),
            case("bolted", 2, "--degree", "2", solver="direct", ranks=2),
        ),
    ),
    "bolted_250k": Group(
        "the same, 269 133 unknowns",
        (
            case("bolted", 11, "--degree", "2", solver="multigrid", ranks=2),
            case("bolted", 11, "--degree", "2", ranks=2),
        ),
    ),
    "bolted_tfeti_40k": Group(
        "one elastic level by Total FETI, against active sets that factorise, 41 979 unknowns",
        one_level(2),
    ),
    "bolted_tfeti_250k": Group("the same, 269 133 unknowns", one_level(11), rounds=1),
    "bolted_1m": Group(
        "the same, 999 090 unknowns",
        (case("bolted", 19, "--degree", "2", ranks=2),),
        rounds=1,
    ),
    "bolted_apart": Group(
        "the assembly of bodies that were meshed apart: mortar contact",
        (case("bolted_apart", 2, "--degree", "2"),),
        rounds=1,
    ),
    "bolted_limit": Group(
        "its limit load to 1e-3, 269 133 unknowns",
        (limit("bolted", 11, "--degree", "2", ranks=2),),
        rounds=1,
    ),
    "shells_limit_1m": Group(
        "limit load of two thick shells to 1e-2, a million unknowns: a path without factors",
        (limit("shells", 36, "--degree", "2", "--rtol", "1e-2", ranks=2),),
        rounds=1,
    ),
    "step42": Group(
        "per unknown and Newton step, against deal.II's step-42 (hexahedra)",
        (
            case("punch", 32),
            step42(1),
            case("punch", 32, ranks=2),
            step42(2),
        ),
    ),
    "calculix": Group(
        "the same .inp by CalculiX, with its last converged increment beside the bracket",
        tuple(calculix(name, k) for k in (1, 30) for name in ("punch", "wedge", "prop")),
        rounds=1,
    ),
    "scaling": Group(
        "two blocks on more ranks than cores: counts and memory, not times",
        tuple(case("two_blocks", 12, solver="multigrid", ranks=r) for r in (1, 2, 4, 8)),
        rounds=1,
    ),
}
