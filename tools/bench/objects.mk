# tessera-bench: how long the detector takes; count_frame: how many instructions.
count_frame := $O/tests/count_frame
$(count_frame): $(call objects,tools/bench/count_frame.c) \
                $(patsubst %,$O/lib%.a,firmware detect vector targetfile common)
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -o $@ $< -Wl,--start-group $(filter %.a,$^) -Wl,--end-group -lpng -lcjson -lm $(cross_libs)

.PHONY: count_frame
count_frame: $(count_frame)

ifeq ($(ARCH),native)
count_plugin := $O/count_plugin.so
$(count_plugin): tools/bench/count_plugin.c
	$(call say,CC,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(CFLAGS) -shared -fPIC -o $@ $<

tessera-bench_FLAGS := -isystem /usr/include/opencv4
tessera-bench_SRC := tools/bench/bench_main.cc
tessera-bench_LIBS := firmware detect vector targetfile common
tessera-bench_LDLIBS := -lopencv_imgproc -lopencv_core -lfmt -lpng -lcjson -lm
$(eval $(call program,tessera-bench))

# Frames full of target, rendered once.
bench_dir := build/bench
bench_1080p := $(bench_dir)/1080p/cam0
bench_12mp := $(bench_dir)/12mp/cam0

$(bench_dir)/target.json:
	@$(MAKE) --no-print-directory build/bin/tessera-target
	$(Q)mkdir -p $(@D)
	$(Q)build/bin/tessera-target --rows 64 --cols 64 --patch-mm 20 --seed 3 --out $@

$(bench_dir)/%/rendered: tools/bench/bench_%.json | $(bench_dir)/target.json
	@$(MAKE) --no-print-directory build/bin/tessera-render
	$(Q)rm -rf $(@D) && cp $< $(bench_dir)/
	$(Q)build/bin/tessera-render $(bench_dir)/bench_$*.json --out $(@D) && touch $@

## bench: the detector's time over a Gaussian blur's, by stage, on frames full of target
.PHONY: bench
bench: $(BIN)/tessera-bench $(bench_dir)/1080p/rendered $(bench_dir)/12mp/rendered
	@$(BIN)/tessera-bench --target $(bench_dir)/target.json $(BENCH) \
	    $(sort $(wildcard $(bench_1080p)/*.pgm) $(wildcard $(bench_12mp)/*.pgm))

## bench-count: instructions a pixel (callgrind; aarch64 in QEMU after `make cross-deps`)
.PHONY: bench-count
bench-count: $(count_frame) $(count_plugin) $(bench_dir)/1080p/rendered $(bench_dir)/12mp/rendered
	@test ! -f build/deps/arm64/complete || $(MAKE) --no-print-directory ARCH=aarch64 count_frame
	@tools/bench/count.sh $(bench_dir)/target.json $(bench_1080p)/frame_00000.pgm $(bench_12mp)/frame_00000.pgm
endif
