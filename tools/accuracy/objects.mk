# The detector measured against rendered truth and the Cramer-Rao limit.
accuracy_programs := $(addprefix $(BIN)/tessera-,target render detect)

## accuracy: measure the detector on all conditions; rewrites docs/accuracy.md and its figures
.PHONY: accuracy
accuracy: $(accuracy_programs)
	@$(PYTHON) tools/accuracy/accuracy.py --out docs $(ACCURACY)

## accuracy-short: the same on few small frames, printed only
.PHONY: accuracy-short
accuracy-short: $(accuracy_programs)
	@$(PYTHON) tools/accuracy/accuracy.py --short $(ACCURACY)
