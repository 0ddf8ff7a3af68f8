# Tessera. `make help` lists the targets. Everything built goes below build/; each part lists its
# sources in its objects.mk.

.DEFAULT_GOAL := help
MAKEFLAGS += --no-builtin-rules
.DELETE_ON_ERROR:

ifeq ($(origin CC),default)
CC  := gcc
CXX := g++
endif
# ARCH=aarch64, armhf: the device's programs for another processor, static, into build/ARCH/bin.
ARCH ?= native
ifneq ($(ARCH),native)
.DEFAULT_GOAL := all
include tests/cross/$(ARCH).mk
CC  := $(cross_prefix)gcc
CXX := $(cross_prefix)gcc
AR  := $(cross_prefix)ar
cross_deps := build/deps/$(cross_debian)
endif
AR        ?= ar
PKGCONFIG ?= pkg-config
# Debian's own Python: the one that sees Debian's modules.
PYTHON    ?= /usr/bin/python3

# Variants live side by side, so that switching costs no rebuild.
# DSP_VERIFY=1: vector kernels run beside plain C, which must give the same (firmware/app/dsp_verify.h).
# GUIDED=1: as libFuzzer wants it, and counting lines.
variant := $(ARCH)$(if $(SAN),-san)$(if $(DSP_VERIFY),-verify)$(if $(GUIDED),-guided)$(if $(filter-out gcc $(cross_prefix)gcc,$(CC)),-$(notdir $(CC)))
O       := build/$(variant)
BIN     := $(if $(filter native,$(variant)),build/bin,$O/bin)

Q   := $(if $(V),,@)
say  = $(if $(V),,@printf '  %-6s %s\n' $(1) $(2))

warn      := -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wvla -Wundef -Werror
comma     := ,
sanitize  := $(if $(SAN),-fsanitize=address$(comma)undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
guided    := $(if $(GUIDED),-fsanitize=fuzzer-no-link -fprofile-instr-generate -fcoverage-mapping)
CPPFLAGS  := -I. -D_GNU_SOURCE -MMD -MP
CFLAGS    := -std=c11 -O2 -g $(warn) -Wmissing-prototypes -Wstrict-prototypes $(sanitize) $(guided)
CXXFLAGS  := -std=c++17 -O2 -g $(warn) $(sanitize) $(guided)
LDFLAGS   := -Wl,--as-needed $(sanitize) $(if $(GUIDED),-fprofile-instr-generate)
ifneq ($(ARCH),native)
CPPFLAGS += -isystem $(cross_deps) -isystem $(cross_deps)/usr/include
LDFLAGS  += -static -L$O -L$(cross_deps)/usr/lib/$(patsubst %-,%,$(cross_prefix))
cross_libs := -lz -lm
endif
# Third-party headers are system headers: their warnings are not ours.
system_cflags = $(patsubst -I%,-isystem%,$(shell $(PKGCONFIG) --cflags $(1) 2>/dev/null))
system_libs   = $(shell $(PKGCONFIG) --libs $(1))

# The core may not compute in floating point: this flag makes the compiler refuse it.
# Sanitizers pad stack frames, so they are measured without.
# GCC writes down calls and frames beside the objects, for `make size`.
graph_flags := $(if $(SAN),,$(if $(findstring clang,$(CC)),,-fcallgraph-info=su))
core_flags := -mgeneral-regs-only $(if $(SAN),,-Wframe-larger-than=2048) $(graph_flags)

# $(call objects,SOURCES): their object files.
objects = $(patsubst %,$O/%.o,$(1))
# $(eval $(call library,NAME)): $O/libNAME.a from NAME_SRC, compiled with NAME_FLAGS.
define library
$O/lib$(1).a: $(call objects,$($(1)_SRC))
$(call objects,$($(1)_SRC)): private part_flags := $($(1)_FLAGS)
endef
# $(eval $(call program,NAME)): $(BIN)/NAME from NAME_SRC compiled with NAME_FLAGS, our archives
# NAME_LIBS in link order, and the linker's words NAME_LDLIBS.
define program
PROGRAMS += $(BIN)/$(1)
$(BIN)/$(1): $(call objects,$($(1)_SRC)) $(patsubst %,$O/lib%.a,$($(1)_LIBS))
$(BIN)/$(1): private LDLIBS := $($(1)_LDLIBS)
$(call objects,$($(1)_SRC)): private part_flags := $($(1)_FLAGS)
endef

include common/objects.mk firmware/objects.mk
ifeq ($(ARCH),native)
include host/objects.mk
include $(sort $(wildcard tools/*/objects.mk))
include tests/fuzz/objects.mk tests/cost/objects.mk tests/objects.mk
endif
ifneq ($(ARCH),native)
include tools/bench/objects.mk
endif
include tests/simd/objects.mk tests/golden/objects.mk tests/cross/objects.mk

$O/%.c.o: %.c
	$(call say,CC,$<)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(CPPFLAGS) $(CFLAGS) $(part_flags) -c -o $@ $<

$O/%.cc.o: %.cc
	$(call say,CXX,$<)
	$(Q)mkdir -p $(@D)
	$(Q)$(CXX) $(CPPFLAGS) $(CXXFLAGS) $(part_flags) -c -o $@ $<

$O/lib%.a:
	$(call say,AR,$@)
	$(Q)mkdir -p $(@D)
	$(Q)rm -f $@ && $(AR) rcs $@ $^

$(PROGRAMS):
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CXX) $(LDFLAGS) -o $@ $(filter %.o,$^) -Wl,--start-group $(filter %.a,$^) -Wl,--end-group $(LDLIBS) $(cross_libs)

-include $(shell find $O -name '*.d' 2>/dev/null)

# The two commands compile on all cores, unless told otherwise by a -j.
jobs = $(if $(findstring -j,$(MAKEFLAGS)),,-j$(shell nproc))

## all: build every program into build/bin
.PHONY: all
all: $(PROGRAMS) $(ALSO_BUILT)

## demo: install what is missing, build, and calibrate a simulated rig end to end
.PHONY: demo
demo:
	@tools/setup/deps.sh build
	@$(MAKE) --no-print-directory $(jobs) all
	@tools/demo/demo.sh

## test: install what is missing, build, and run every test
.PHONY: test
test:
	@tools/setup/deps.sh build test
	@$(MAKE) --no-print-directory $(jobs) test-programs
	@$(MAKE) --no-print-directory $(jobs) SAN=1 test-programs-light
	@$(MAKE) --no-print-directory check

## deps: install the packages that building and testing need
.PHONY: deps
deps:
	@tools/setup/deps.sh build test

## compile_commands.json: for editors and clang tools
compile_commands.json: FORCE
	@$(MAKE) --no-print-directory --dry-run --always-make V=1 all | $(PYTHON) tools/setup/compile_commands.py > $@

## clean: remove everything built
.PHONY: clean
clean:
	rm -rf build

## help: this list
.PHONY: help FORCE
help:
	@echo 'Targets (SAN=1: with sanitizers; DSP_VERIFY=1: vector kernels held against plain C; V=1: show commands; -j N: on N cores; CC=clang CXX=clang++: other compiler)'
	@sed -n 's/^## \([^:]*\): */\1\t/p' $(MAKEFILE_LIST) | while IFS='	' read -r target text; do \
	    printf '  %-22s %s\n' "$$target" "$$text"; done
