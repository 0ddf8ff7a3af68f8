# Tests. A file tests/unit/test_NAME.c or tests/unit_host/test_NAME.cc is one Unity program; it links
# with everything. tests/system/test_*.py are pytest files that run the built programs.
unity_SRC := build/deps/unity/unity.c
unity_FLAGS := -w
$(eval $(call library,unity))

# What the unit tests share: pictures and contours with known truth.
synth_SRC := tests/unit/synth.c tests/unit/synth_patch.c
synth_FLAGS := -isystem build/deps/unity
$(eval $(call library,synth))

unit_LIBS := synth firmware detect vector targetfile common

# Host tests that need no more than socket and journal.
gather_tests := journal packets

unit_SRC      := $(sort $(wildcard tests/unit/test_*.c))
unit_host_SRC := $(sort $(wildcard tests/unit_host/test_*.cc))
unit_BIN      := $(patsubst tests/%.c,$O/tests/%,$(unit_SRC))
gather_BIN    := $(gather_tests:%=$O/tests/unit_host/test_%)
unit_host_BIN := $(filter-out $(gather_BIN),$(patsubst tests/%.cc,$O/tests/%,$(unit_host_SRC)))

$(call objects,$(unit_SRC)): private part_flags := -isystem build/deps/unity
$(call objects,$(unit_host_SRC)): private part_flags := -isystem build/deps/unity $(host_FLAGS)
$(unit_BIN): $O/tests/%: $O/tests/%.c.o $(unit_LIBS:%=$O/lib%.a) $O/libunity.a
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< -Wl,--start-group $(filter %.a,$^) -Wl,--end-group -lcjson -lpng -lm
$(unit_host_BIN): $O/libhost.a
$(unit_host_BIN) $(gather_BIN): $O/tests/%: $O/tests/%.cc.o $O/libgather.a $(unit_LIBS:%=$O/lib%.a) $O/libunity.a
	$(call say,LINK,$@)
	$(Q)$(CXX) $(LDFLAGS) -o $@ $< -Wl,--start-group $(filter %.a,$^) -Wl,--end-group -lcjson -lpng $(host_LDLIBS)

# The detector's stages laid open, for tests/diff.
dump_stages := $O/tests/dump_stages
$(dump_stages): $(call objects,tests/diff/dump_stages.c) $(patsubst %,$O/lib%.a,firmware detect vector targetfile common)
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< -Wl,--start-group $(filter %.a,$^) -Wl,--end-group -lcjson -lpng -lm

## check: run every test on what is built (no installing)
.PHONY: check
check:
	+@$(PYTHON) tests/run_stages.py $(MAKE) tables layers names symbols size simd golden unit sanitize system

# What the stages run: built at once, before the first.
.PHONY: test-programs test-programs-light
test-programs: all $(unit_BIN) $(gather_BIN) $(unit_host_BIN) $(replay_host_BIN) $(dump_stages)
test-programs-light: $(unit_BIN) $(gather_BIN) $(replay_light_BIN)

## unit: the Unity programs of tests/unit and tests/unit_host
.PHONY: unit
unit: $(unit_BIN) $(gather_BIN) $(unit_host_BIN) $(replay_host_BIN)
	@$(PYTHON) tests/run_units.py $^

## error-bars: 2000 simulated solves against the covariance and the error bars in px and mm of each
.PHONY: error-bars
error-bars: $(patsubst %,$O/tests/unit_host/test_%,uncertainty error_bars compare prior rolling)
	@for test in $^; do TESSERA_DRAWS=2000 $$test || exit 1; done

# Where pycolmap goes: some 100 MB, for one test.
build/deps/pycolmap:
	@$(PYTHON) -m pip install -q --no-deps --target $@.part pycolmap==4.2.1
	@mv $@.part $@

## export-peers: install mrcal (400 MB) and pycolmap, and read every exported format with its owner's library
.PHONY: export-peers
export-peers: $(BIN)/tessera-rig
	@tools/setup/deps.sh build test peers
	@$(MAKE) --no-print-directory build/deps/pycolmap
	@$(PYTHON) -m pytest -q -rs tests/system/test_export.py

## sanitize: the C core, the device's edge, wire, socket and journal under ASan and UBSan
.PHONY: sanitize
sanitize:
	@$(MAKE) --no-print-directory SAN=1 unit-light

# Without the solver: Ceres and OpenCV take minutes to compile with sanitizers and are not ours.
.PHONY: unit-light
unit-light: $(unit_BIN) $(gather_BIN) $(replay_light_BIN)
	@$(PYTHON) tests/run_units.py $^

## system: run the built programs as a user would (pytest)
.PHONY: system
system: all $(dump_stages)
	@TESSERA_DUMP_STAGES=$(abspath $(dump_stages)) $(PYTHON) -m pytest -q tests/system tests/diff
