# docker build -t perfplast .
# docker run --rm --shm-size=1g perfplast make demo
# docker run --rm --shm-size=1g -v "$PWD:/cases" -w /cases perfplast \
#     mpirun -n 2 perfplast run case.toml -o results
FROM debian:trixie-slim

COPY packages.txt /tmp/
RUN apt-get update \
    && sed 's/#.*//' /tmp/packages.txt | DEBIAN_FRONTEND=noninteractive \
        xargs apt-get install -y --no-install-recommends \
    && apt-get clean && rm -rf /var/lib/apt/lists/* /tmp/packages.txt

# These are the variables that ./fenicsx sets, for commands that run without it.
ENV LANG=C.UTF-8 \
    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 \
    OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 \
    PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe PRTE_MCA_mapby=:oversubscribe \
    OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_btl=self,sm OMPI_MCA_mpi_yield_when_idle=1

RUN useradd --create-home --shell /bin/bash perfplast \
    && install -d -o perfplast -g perfplast /home/perfplast/perfplast_fenicsx
COPY --chown=perfplast:perfplast . /home/perfplast/perfplast_fenicsx
WORKDIR /home/perfplast/perfplast_fenicsx
# Debian has all dependencies and the build tool, so nothing is downloaded from PyPI.
RUN pip install --no-deps --no-build-isolation --no-index --no-cache-dir \
        --break-system-packages --root-user-action=ignore . \
    && rm -rf build *.egg-info

USER perfplast
CMD ["make", "help"]
