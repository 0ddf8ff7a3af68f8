# Golden frames: every processor and every variant of the row kernels makes the same packets of them.
golden_frames   := $(sort $(wildcard tests/golden/frames/*.pgm))
golden_expected := tests/golden/frames/digests.txt
golden_digest   := $O/tests/golden_digest
$(golden_digest): $(call objects,tests/golden/golden_digest.c tests/golden/golden_run.c) \
                  $(patsubst %,$O/lib%.a,firmware detect vector common)
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -o $@ $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) -Wl,--end-group

## golden: the golden frames give the expected packets, with every variant that runs here
.PHONY: golden
golden: $(golden_digest)
	@$(cross_run) $(golden_digest) $(golden_frames) > $O/golden.txt
	@diff $(golden_expected) $O/golden.txt || { echo 'golden: packets changed ($(ARCH)); where that is meant, run make golden-accept' >&2; exit 1; }
	@echo 'golden: $(ARCH) agrees on $(words $(golden_frames)) frames'

## golden-accept: take the packets of today's detector as the expected ones
.PHONY: golden-accept
golden-accept: $(golden_digest)
	@$(golden_digest) $(golden_frames) > $(golden_expected).part && mv $(golden_expected).part $(golden_expected)
	@cat $(golden_expected)

## dsp-verify: the golden frames with every result of every vector kernel held against plain C (DSP_VERIFY=1)
.PHONY: dsp-verify
dsp-verify:
	@$(MAKE) --no-print-directory DSP_VERIFY=1 golden
