# The solver measured against simulated truth and other people's solvers.

## solver-accuracy: measure the solver on all scenarios; rewrites docs/solver_accuracy.md (SOLVER='--only paper --seeds 8')
.PHONY: solver-accuracy
solver-accuracy: $(BIN)/tessera-rig
	@$(PYTHON) tools/solver_bench/solver_accuracy.py --out docs $(SOLVER)

## solver-honesty: errors over claimed standard deviations, on many draws of a small rig (HONESTY='--seeds 100')
.PHONY: solver-honesty
solver-honesty: $(BIN)/tessera-rig
	@$(PYTHON) tools/solver_bench/solver_honesty.py $(HONESTY)
