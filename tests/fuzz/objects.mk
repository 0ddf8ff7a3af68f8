# Fuzz targets: any bytes through the detector and through every parser of bytes from outside. Each is linked
# twice: with replay_main.c, which runs its kept inputs (tests/fuzz/corpus), and by clang with libFuzzer, which
# looks for new ones.
fuzz_names := frame image journal packets recording rig scene targetfile wire

fuzz_frame_LIBS      := detect vector firmware common
fuzz_image_LIBS      := firmware
fuzz_image_LDLIBS    := -lpng
fuzz_journal_LIBS    := gather common
fuzz_packets_LIBS    := gather common
fuzz_packets_LDLIBS  := -lfmt
fuzz_recording_SRC   := $(addprefix tools/v4l2_shim/,pgm_head.c times_csv.c raw_kind.c folder.c)
fuzz_recording_LDLIBS := -lcjson
fuzz_rig_SRC         := host/report/rig_file.cc host/report/spline_json.cc host/report/covariance_json.cc \
                        host/solve/surface.cc host/base/bspline.cc $(filter host/model/%,$(host_SRC))
fuzz_scene_SRC       := $(addprefix host/obs/,scene.cc baselines.cc observations_file.cc target_board.cc \
                                                 digest.cc) host/base/csv.cc
fuzz_scene_LIBS      := targetfile common
fuzz_scene_LDLIBS    := -lcjson -lfmt
fuzz_targetfile_LIBS := targetfile common
fuzz_targetfile_LDLIBS := -lcjson
fuzz_wire_LIBS       := common

fuzz_object = $(call objects,$(wildcard tests/fuzz/fuzz_$(1).c tests/fuzz/fuzz_$(1).cc))
$(call fuzz_object,rig) $(call fuzz_object,scene): private part_flags := $(host_FLAGS)
$O/tests/fuzz/replay_main.c.o: private part_flags := -isystem build/deps/unity

# $(eval $(call fuzz_programs,NAME))
define fuzz_programs
$O/tests/fuzz/replay_$(1) $O/tests/fuzz/fuzz_$(1): $(call fuzz_object,$(1)) $(call objects,$(fuzz_$(1)_SRC)) \
                                                   $(patsubst %,$O/lib%.a,$(fuzz_$(1)_LIBS))
$O/tests/fuzz/replay_$(1) $O/tests/fuzz/fuzz_$(1): private LDLIBS := $(fuzz_$(1)_LDLIBS) -lm
endef
$(foreach name,$(fuzz_names),$(eval $(call fuzz_programs,$(name))))

# Kept inputs run with the unit tests: the light ones under the sanitizers, those of Eigen and JSON, which take
# long to compile so, without.
replay_BIN       := $(fuzz_names:%=$O/tests/fuzz/replay_%)
replay_host_BIN  := $(filter %_rig %_scene,$(replay_BIN))
replay_light_BIN := $(filter-out $(replay_host_BIN),$(replay_BIN))
$(replay_BIN): $O/tests/fuzz/replay_main.c.o $O/libunity.a
$(replay_BIN): private fuzz_link :=
guided_BIN := $(fuzz_names:%=$O/tests/fuzz/fuzz_%)
$(guided_BIN): private fuzz_link := -fsanitize=fuzzer
$(replay_BIN) $(guided_BIN):
	$(call say,LINK,$@)
	$(Q)$(CXX) $(LDFLAGS) $(fuzz_link) -o $@ $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) -Wl,--end-group $(LDLIBS)

# Frames at random under the sanitizers; a case that fails is kept as build/fuzz/frame_case.hex.
drive_frame := $O/tests/fuzz/drive_frame
$(drive_frame): $(call objects,tests/fuzz/drive_frame.c tests/fuzz/fuzz_frame.c) $(patsubst %,$O/lib%.a,detect vector firmware common)
	$(call say,LINK,$@)
	$(Q)$(CC) $(LDFLAGS) -o $@ $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) -Wl,--end-group -lm

T ?= 60
FUZZ ?= $(fuzz_names)
fuzz_clang := $(firstword $(foreach name,clang clang-14,$(shell command -v $(name))))
fuzz_make   = $(MAKE) --no-print-directory SAN=1 GUIDED=1 CC=$(notdir $(fuzz_clang)) CXX=$(notdir $(fuzz_clang:clang%=clang++%))

## fuzz-deps: install clang, for fuzzing led by coverage
.PHONY: fuzz-deps
fuzz-deps:
	@tools/setup/deps.sh build fuzz

## fuzz: T=60 seconds of inputs led by coverage through each of FUZZ="frame wire ..." (all) under the sanitizers
.PHONY: fuzz fuzz-run fuzz-random
ifneq ($(fuzz_clang),)
fuzz:
	@$(fuzz_make) fuzz-run
else
fuzz:
	@echo 'fuzz: clang is not installed (make fuzz-deps): frames at random only'
	@$(MAKE) --no-print-directory SAN=1 fuzz-random
endif
fuzz-run: $(FUZZ:%=$O/tests/fuzz/fuzz_%)
	@$(PYTHON) tests/fuzz/fuzz_guided.py --seconds $T $^
fuzz-random: $(drive_frame)
	@mkdir -p build/fuzz
	@$(drive_frame) $T build/fuzz $(FIRST)

## fuzz-keep: take what fuzzing found into tests/fuzz/corpus, least inputs of the same coverage
.PHONY: fuzz-keep fuzz-keep-run
fuzz-keep:
	@$(fuzz_make) fuzz-keep-run
fuzz-keep-run: $(FUZZ:%=$O/tests/fuzz/fuzz_%)
	@$(PYTHON) tests/fuzz/fuzz_guided.py --keep $^
