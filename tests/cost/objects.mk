# What frames made to be slow cost.
cost_frames := $O/tests/cost_frames
$(cost_frames): $(call objects,tests/cost/cost_frames.c tests/cost/hard_frames.c) \
                $(patsubst %,$O/lib%.a,firmware detect vector common)
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -o $@ $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) -Wl,--end-group -lm

## worst-frames: instructions of frames made to be slow over those of a frame full of target, 1080p (callgrind)
.PHONY: worst-frames
worst-frames: $(cost_frames)
	@$(PYTHON) tests/cost/worst_frames.py $(cost_frames) $(WORST)
