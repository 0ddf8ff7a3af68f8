# Checks that hold the house up: each prints the file at fault, and is run by `make check`.

## tables: the committed tables are what their generators write
.PHONY: tables
tables:
	@set -e; for generator in tools/gen/*_table.py; do $(PYTHON) $$generator --check; done
	@echo 'tables: every one is what its generator writes'

## layers: includes follow the street
.PHONY: layers
layers:
	@$(PYTHON) tools/check/layers.py

## names: source files have unique names, modules export only names of their own
.PHONY: names
names: $(call objects,$(common_SRC) $(targetfile_SRC) $(detect_SRC) $(firmware_SRC))
	@tools/check/names.sh $O

## symbols: the core's objects hold no floating point, no heap, no system call (not with SAN=1)
.PHONY: symbols
symbols: $O/libcommon.a $O/libdetect.a
ifeq ($(SAN),)
	@tools/check/symbols.sh $^
else
	@echo 'symbols: skipped, for sanitizers add calls of their own'
endif

memory_limits := $O/tests/memory_limits
$(memory_limits): $(call objects,tools/check/memory.c) $O/libdetect.a $O/libcommon.a
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< -Wl,--start-group $(filter %.a,$^) -Wl,--end-group

## size: the detector's memory and deepest stack, against their limits (stack: GCC, not with SAN=1)
.PHONY: size
size: $(memory_limits) $O/libcommon.a $O/libdetect.a $O/libvector.a
	@$(memory_limits)
ifeq ($(graph_flags),)
	@echo 'size: stack not measured in this build'
else
	@$(PYTHON) tools/check/stack.py 16384 pipeline_run $(patsubst %.c,$O/%.c.ci,$(common_SRC) $(detect_SRC) $(vector_SRC))
endif
