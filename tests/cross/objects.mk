# Other processors under emulation: the same bytes everywhere.

# Debian has no static cJSON for the programs of ARCH.
ifneq ($(ARCH),native)
cjson_SRC := $(cross_deps)/cjson/cJSON.c
cjson_FLAGS := -w
$(eval $(call library,cjson))
$(PROGRAMS) $(count_frame): | $O/libcjson.a
# The camera looks up hosts, which needs the C library's own plug-ins: not static.
$(BIN)/tessera-cam: private LDFLAGS := $(filter-out -static,$(LDFLAGS))
endif

# A microcontroller without an operating system: the first golden frame lies in its flash.
m7_SRC := $(common_SRC) $(detect_SRC) tests/golden/golden_run.c tests/cross/m7_main.c tests/cross/m7_start.c
m7_frame := tests/golden/frames/tilted.pgm
build/m7/golden.elf: $(m7_SRC) tests/cross/m7.ld $(m7_frame) $(wildcard firmware/*.h firmware/*/*.h common/*/*.h)
	$(call say,M7,$@)
	$(Q)mkdir -p $(@D)
	$(Q)arm-none-eabi-gcc -std=c11 -O2 -g $(warn) -I. -mcpu=cortex-m7 -mthumb -mfloat-abi=soft \
	    --specs=rdimon.specs -nostartfiles -T tests/cross/m7.ld -o $@ $(m7_SRC)

.PHONY: golden-m7
golden-m7: build/m7/golden.elf
	@qemu-system-arm -M mps2-an500 -nographic -monitor none -serial none \
	    -semihosting-config enable=on,target=native -kernel $< > build/m7/golden.txt
	@grep '^$(notdir $(m7_frame)) ' $(golden_expected) | diff - build/m7/golden.txt
	@echo 'golden: Cortex-M7 agrees on $(m7_frame)'

## cross-deps: install the cross compilers and emulators, fetch libraries for the other processors
.PHONY: cross-deps
cross-deps:
	@tools/setup/deps.sh cross
	@tools/setup/foreign.sh arm64
	@tools/setup/foreign.sh armhf

## test-cross: build for aarch64, armhf and a bare Cortex-M7; the golden frames give the same bytes there
.PHONY: test-cross
test-cross: cross-deps
	@$(MAKE) --no-print-directory golden
	@$(MAKE) --no-print-directory ARCH=aarch64 all simd golden
	@$(MAKE) --no-print-directory ARCH=armhf all simd golden
	@$(MAKE) --no-print-directory golden-m7
