host_FLAGS := $(call system_cflags,eigen3) -isystem /usr/include/opencv4
host_LDLIBS := -lceres -lglog -lopencv_calib3d -lopencv_imgcodecs -lopencv_imgproc -lopencv_core -lfmt -lspdlog -lpthread
host_SRC := \

$(eval $(call library,host))
