host_FLAGS := $(call system_cflags,eigen3) -isystem /usr/include/opencv4
host_LDLIBS := -lceres -lglog -lopencv_calib3d -lopencv_imgcodecs -lopencv_imgproc -lopencv_core -lfmt -lspdlog -lpthread
host_SRC := \
  host/net/packets.cc \
  host/net/listener.cc \
  host/journal/journal_reader.cc \
  host/journal/journal_writer.cc \

$(eval $(call library,host))

# The host's program; one file a subcommand.
tessera-rig_FLAGS  := $(host_FLAGS)
tessera-rig_LIBS   := host targetfile common
tessera-rig_LDLIBS := -lcjson $(host_LDLIBS)
tessera-rig_SRC := \
  host/rig/main.cc \
  host/rig/cmd_receive.cc \
  host/rig/announce.cc \
  host/rig/receiver.cc \
  host/rig/cmd_journal.cc \

$(eval $(call program,tessera-rig))
