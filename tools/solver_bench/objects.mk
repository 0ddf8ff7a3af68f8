# The solver measured against simulated truth and other people's solvers.

## solver-accuracy: measure the solver on all scenarios; rewrites docs/solver_accuracy.md (SOLVER='--only paper --seeds 8')
.PHONY: solver-accuracy
solver-accuracy: $(BIN)/tessera-rig
	@$(PYTHON) tools/solver_bench/solver_accuracy.py --out docs $(SOLVER)

## solver-honesty: errors over claimed standard deviations, on many draws of a small rig (HONESTY='--seeds 100')
.PHONY: solver-honesty
solver-honesty: $(BIN)/tessera-rig
	@$(PYTHON) tools/solver_bench/solver_honesty.py $(HONESTY)

## solver-bench: the solver's time and memory beside mrcal's and OpenCV's, and its growth (BENCH_SOLVER='--only room --rounds 1')
.PHONY: solver-bench
solver-bench: $(BIN)/tessera-rig
	@$(PYTHON) tools/solver_bench/solver_bench.py $(BENCH_SOLVER)

## solver-speed: the same and the room of 16 cameras and 1.6 million points; rewrites docs/solver_speed.md (20 minutes)
.PHONY: solver-speed
solver-speed: $(BIN)/tessera-rig
	@$(PYTHON) tools/solver_bench/solver_bench.py --only '^paper$$|^room|^growth' --rounds 1 --out docs $(BENCH_SOLVER)

## peers: install the other solvers that solver-bench compares with (Debian's mrcal; mrcal 2.5 where a Python 3.12 is)
.PHONY: peers
peers:
	@tools/setup/deps.sh test peers
	@tools/setup/mrcal.sh

# The paper's rig once, as part of `make bench`.
.PHONY: solver-race
solver-race: $(BIN)/tessera-rig
	@$(PYTHON) tools/solver_bench/solver_bench.py --only '^paper$$' --rounds 1
bench: solver-race
