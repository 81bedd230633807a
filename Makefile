# All commands run through ./fenicsx, which makes the environment if it is missing.
# LIMIT is a generous time limit for each run (s), so that a run that hangs ends with a failure.
export LIMIT = 3600
RUN = timeout --foreground --kill-after=30 $(LIMIT) ./fenicsx

.PHONY: help demo test pip-test verify tribunal lint docs image-test package clean

help:
	@echo 'make demo        two blocks in contact, on 2 MPI ranks'
	@echo 'make test        tests on 1 rank, some on 2, a few on 3'
	@echo 'make pip-test    the demo and a twentieth of the tests with the packages of PyPI'
	@echo 'make verify      the tests that make test omits; PART=random runs one part of them'
	@echo 'make tribunal    verdicts on published factors and limit loads: docs/tribunal.md; NAMES="cheng" selects'
	@echo 'make bench       run times and memory: benchmarks/README.md (hours)'
	@echo 'make lint        ruff and mypy'
	@echo 'make docs        the documentation site, in build/docs/index.html'
	@echo 'make image-test  build the image of the Dockerfile, and run demo and tests in it'
	@echo 'make package     sdist and wheel in build/dist, checked by twine and built twice'
	@echo 'make clean       remove files of runs and tools from this folder'
	@echo './fenicsx CMD    any command in the environment, such as ./fenicsx perfplast run case.toml'

# No time limit includes the creation of the environment.
.PHONY: environment
environment:
	@./fenicsx --way

demo: environment
	./fenicsx mpirun -n 2 python3 demos/two_blocks.py

test: environment
	@scripts/test

# PART=random (or exact, long, two-ranks-..., see below) runs one part alone; each ends within an hour.
PARTS = exact random long two-ranks-bounds two-ranks-solvers two-ranks-rest
pip-test:
	@scripts/pip-test

verify: environment
	@for part in $(if $(PART),$(PART),$(PARTS)); do $(MAKE) --no-print-directory "verify-$$part" || failed=1; done; \
	[ -z "$$failed" ]

ALL_CASES = PERFPLAST_EVERY_CASE=1 $(RUN)
TWO_RANKS = $(ALL_CASES) env OMPI_MCA_mpi_yield_when_idle=1 mpirun -n 2 scripts/rank0 python3 -m pytest -q
BOTH_CORES = --numprocesses=2 --dist=worksteal

.PHONY: $(addprefix verify-, $(PARTS))
verify-exact:
	$(RUN) mpirun -n 2 scripts/rank0 python3 demos/verification/verify.py

verify-random:
	PERFPLAST_EVERY_CASE=1 PERFPLAST_FUZZ=20 $(RUN) python3 -m pytest -q $(BOTH_CORES) tests/functional/test_strictness.py
	PERFPLAST_FUZZ=25 $(RUN) python3 -m pytest -q $(BOTH_CORES) tests/functional/test_random_ground.py
	PERFPLAST_EVERY_CASE=1 PERFPLAST_FUZZ=42 $(RUN) python3 -m pytest -q $(BOTH_CORES) tests/functional/test_random_statements.py
	PERFPLAST_EVERY_CASE=1 PERFPLAST_FUZZ=2 $(RUN) python3 -m pytest -q $(BOTH_CORES) tests/combinations
	PERFPLAST_FUZZ=10 $(RUN) python3 -m pytest -q $(BOTH_CORES) tests/functional/test_fuzz.py
	PERFPLAST_FUZZ=50 $(RUN) python3 -m pytest -q $(BOTH_CORES) tests/contact/test_clipping.py
	PERFPLAST_EVERY_CASE=1 PERFPLAST_FUZZ=10 $(RUN) python3 -m pytest -q $(BOTH_CORES) tests/proof/test_random_*.py

verify-long:
	$(ALL_CASES) python3 -m pytest -q $(BOTH_CORES) -m long tests
	$(ALL_CASES) python3 -m pytest -q $(BOTH_CORES) -m 'not long' tests/functional/test_demos.py

verify-two-ranks-bounds:
	$(TWO_RANKS) tests/limit_analysis tests/proof

verify-two-ranks-solvers:
	$(TWO_RANKS) tests/solvers tests/contact tests/problem tests/materials

verify-two-ranks-rest:
	$(TWO_RANKS) tests --ignore=tests/limit_analysis --ignore=tests/proof --ignore=tests/solvers \
		--ignore=tests/contact --ignore=tests/problem --ignore=tests/materials

# Solved problems are not solved again: build/tribunal stores bounds and proofs.
tribunal: environment
	$(RUN) python3 demos/tribunal/tribunal.py --publish $(if $(NAMES),--only $(NAMES))

# CASES="start punch_16" selects cases, and ROUNDS=1 runs each case once
.PHONY: bench
bench:
	benchmarks/enter python3 -m benchmarks.run $(CASES) $(if $(ROUNDS),--rounds $(ROUNDS))

lint: environment
	$(RUN) scripts/lint

docs: environment
	$(RUN) sphinx-build -W --keep-going -n -q -b html docs build/docs
	@echo 'Open build/docs/index.html'

image-test:
	scripts/image-test

package:
	scripts/package

clean:
	rm -rf build *.egg-info .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
