# tessera-render. -O3: the loops over pixels are worth vectorising. Under the sanitizers that would take
# the compiler minutes a file.
render_FLAGS := $(if $(SAN),-O1,-O3) $(call system_cflags,eigen3)
tessera-render_FLAGS := $(render_FLAGS)
tessera-render_SRC := \
    tools/render/lens.cc \
    tools/render/mosaic.cc \
    tools/render/motion.cc \
    tools/render/raster.cc \
    tools/render/recording.cc \
    tools/render/render_main.cc \
    tools/render/render_scene.cc \
    tools/render/rim_truth.cc \
    tools/render/scene_fields.cc \
    tools/render/sensor.cc
tessera-render_LIBS := targetfile common
tessera-render_LDLIBS := -lcjson -lfmt -lpthread

$(eval $(call program,tessera-render))
