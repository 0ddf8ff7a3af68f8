# The detector, in the order of a frame's way: no operating system, no heap, no floating point.
# -O3: the hot loops are short.
detect_FLAGS := -O3 $(core_flags)
detect_SRC := \
  firmware/detect/luma.c \
  firmware/detect/taps_table.c \
  firmware/detect/dsp_scalar.c \
  firmware/detect/steer.c \
  firmware/detect/edges.c \
  firmware/detect/quota.c \
  firmware/detect/chains.c \
  firmware/detect/arcs.c \
  firmware/detect/ellipse.c \
  firmware/detect/areafit.c \
  firmware/detect/directfit.c \
  firmware/detect/refit.c \
  firmware/detect/ellipses.c \
  firmware/detect/marks.c \
  firmware/detect/patchmap.c \
  firmware/detect/keysort.c \
  firmware/detect/patches.c \
  firmware/detect/survey.c \
  firmware/detect/profile_table.c \
  firmware/detect/boardmap.c \
  firmware/detect/pattern.c \
  firmware/detect/curve_table.c \
  firmware/detect/curve.c \
  firmware/detect/junction.c \
  firmware/detect/rim.c \
  firmware/detect/circlefit.c \
  firmware/detect/light.c \
  firmware/detect/refine.c \
  firmware/detect/lattice.c \
  firmware/detect/packet.c \
  firmware/app/pipeline.c \

$(eval $(call library,detect))

# The row kernels' vector variants: integer arithmetic too, but in vector registers.
vector_SRC := \
  firmware/detect/dsp_sse2.c \
  firmware/detect/dsp_avx2.c \
  firmware/detect/dsp_neon.c \

# -O3: their short loops over taps and columns are to be unrolled.
vector_FLAGS := -O3 $(graph_flags)
$(eval $(call library,vector))
machine := $(shell $(CC) -dumpmachine 2>/dev/null)
$O/firmware/detect/dsp_avx2.c.o: private part_flags := $(vector_FLAGS) $(if $(findstring x86_64,$(machine)),-mavx2)
$O/firmware/detect/dsp_neon.c.o: private part_flags := $(vector_FLAGS) $(if $(findstring arm-,$(machine)),-mfpu=neon)

# The device's edge: capture, sockets, options, files.
firmware_SRC := \
  firmware/capture/capture.c \
  firmware/capture/v4l2.c \
  firmware/capture/v4l2_sys_linux.c \
  firmware/net/sender.c \
  firmware/net/sock_sys_linux.c \
  firmware/app/camera_options.c \
  firmware/app/detector_options.c \
  firmware/app/dsp_choice.c \
  firmware/app/dsp_verify.c \
  firmware/app/image_file.c \

$(eval $(call library,firmware))
$O/firmware/app/dsp_choice.c.o: private part_flags := $(if $(DSP_VERIFY),-DDSP_VERIFY)

tessera-detect_SRC := firmware/app/main_detect.c
tessera-detect_LIBS := firmware detect vector targetfile common
tessera-detect_LDLIBS := -lpng -lcjson -lm
$(eval $(call program,tessera-detect))

tessera-cam_SRC := firmware/app/main_camera.c
tessera-cam_LIBS := firmware detect vector targetfile common
tessera-cam_LDLIBS := -lpng -lcjson -lm
$(eval $(call program,tessera-cam))
