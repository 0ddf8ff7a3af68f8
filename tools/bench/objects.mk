# tessera-bench: how long the detector takes.
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
