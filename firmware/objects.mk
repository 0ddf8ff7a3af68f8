# The detector: no operating system, no heap, no floating point.
detect_FLAGS := $(core_flags)
detect_SRC := \

$(eval $(call library,detect))

# The device's edge: capture, sockets, options, files.
firmware_SRC := \

$(eval $(call library,firmware))
