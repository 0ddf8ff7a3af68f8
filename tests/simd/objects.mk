# The row kernels' variants against the plain ones.
simd_check := $O/tests/simd_check
$(simd_check): $(call objects,tests/simd/simd_check.c tests/simd/simd_rim.c) $(patsubst %,$O/lib%.a,firmware detect vector common)
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -o $@ $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) -Wl,--end-group -lm

## simd: every variant of the row kernels that runs here equals the plain one
.PHONY: simd
simd: $(simd_check)
	@$(cross_run) $(simd_check)
