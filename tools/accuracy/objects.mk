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

## paper-accuracy: the paper's two cameras of 12 MP from pixels to the rig; rewrites docs/paper_accuracy.md (15 minutes)
.PHONY: paper-accuracy
paper-accuracy: $(accuracy_programs) $(BIN)/tessera-rig
	@$(PYTHON) tools/accuracy/paper_rig.py --out docs $(PAPER)

## paper-accuracy-short: the same on 8 small instants, printed only
.PHONY: paper-accuracy-short
paper-accuracy-short: $(accuracy_programs) $(BIN)/tessera-rig
	@$(PYTHON) tools/accuracy/paper_rig.py --short $(PAPER)
