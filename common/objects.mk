# What both halves share. The core: no operating system, no heap, no floating point.
common_FLAGS := $(core_flags)
common_SRC := \

$(eval $(call library,common))

# The target file's reader: heap and cJSON, at start only; one set of rules for both halves.
targetfile_SRC := \

$(eval $(call library,targetfile))
