"""Residual stress of a plate after unloading.

Stages are the parts of a load history. With `Flow`, a material keeps its plastic strain from one
level to the next. After unloading, residual stress and plastic strain remain in the plate.
"""

from mpi4py import MPI

from perfplast_fenicsx import (
    Flow,
    LoadingHistory,
    Newton,
    Problem,
    ResultFolder,
    ResultWriter,
    Scene,
    Stage,
    Support,
    Traction,
    VonMises,
    draw,
    l_plate,
    stage_path,
)

comm = MPI.COMM_WORLD
steel = VonMises(young=206900.0, poisson=0.29, yield_stress=450.0)  # MPa
rollers = [Support("x0", "x"), Support("y0", "y"), Support("z0", "z"), Support("z1", "z")]
loads = [Traction("top", (0.0, 200.0, 0.0), name="pull")]
problem = Problem(l_plate(comm, n=1), {"plate": Flow(steel)}, rollers, loads, degree=2)

stages = [Stage({"pull": 0.9}, steps=3, name="load"), Stage({"pull": 0.0}, name="unload")]
history = LoadingHistory(problem, stages)
newton = Newton(problem)
levels = list(stage_path(newton, history))

loaded, unloaded = levels[2].report, levels[3].report
assert all(level.report.converged for level in levels)
assert loaded.plastic_cells > 100
assert unloaded.plastic_cells < 10  # unloading is elastic, except at the re-entrant corner
assert 0.1 < unloaded.max_displacement / loaded.max_displacement < 0.9

if __name__ == "__main__":
    folder = ResultFolder(comm, "results/ex05", force=True)
    folder.create()
    scene = Scene("A plate, pulled and let go", loads)
    writer = ResultWriter(folder, problem, scene, newton.method, prescribed=newton.prescribes)
    for level in levels:
        if comm.rank == 0:
            print(level)
        writer.write(level)
    writer.results.write()
    draw(folder)  # results/ex05/fields.png
