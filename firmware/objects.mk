# The detector: no operating system, no heap, no floating point.
detect_FLAGS := $(core_flags)
detect_SRC := \
  firmware/detect/packet.c \
  firmware/app/pipeline.c \
  firmware/detect/patches.c \
  firmware/detect/marks.c \
  firmware/detect/arcs.c \
  firmware/detect/ellipses.c \
  firmware/detect/refit.c \
  firmware/detect/ellipse.c \
  firmware/detect/directfit.c \
  firmware/detect/chains.c \
  firmware/detect/edges.c \
  firmware/detect/steer.c \
  firmware/detect/dsp_scalar.c \
  firmware/detect/luma.c \
  firmware/detect/taps_table.c \

$(eval $(call library,detect))

# The device's edge: capture, sockets, options, files.
firmware_SRC := \
  firmware/net/sender.c \
  firmware/net/sock_sys_linux.c \

$(eval $(call library,firmware))
