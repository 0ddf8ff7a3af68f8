# The file-based V4L2 shim: a preloaded library that shows a folder of frames as /dev/videoN, and
# tessera-replay, which runs a command under it. The library lies beside the program.
folder_SRC := $(addprefix tools/v4l2_shim/,folder.c pgm_head.c times_csv.c shim_env.c \
    faults.c)

tessera-replay_SRC := tools/v4l2_shim/main_replay.c tools/v4l2_shim/raw_kind.c $(folder_SRC)
tessera-replay_LDLIBS := -lcjson
$(eval $(call program,tessera-replay))

shim_SRC := $(folder_SRC) $(addprefix tools/v4l2_shim/,answers.c delivery.c interposed_device.c \
    interposed_files.c interposed_waits.c opens.c shim_device.c user_memory.c vqueue.c)
shim_OBJ := $(patsubst %.c,$O/shim/%.c.o,$(shim_SRC))
shim_LIB := $(BIN)/libtessera-v4l2-shim.so

# Loaded into other people's programs: it hides its symbols, and it is never sanitized, because the
# program would then have to be too.
$(shim_OBJ): $O/shim/%.c.o: %.c
	$(call say,CC,$<)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) $(CPPFLAGS) $(CFLAGS) -fno-sanitize=all -fPIC -fvisibility=hidden -c -o $@ $<

$(shim_LIB): $(shim_OBJ)
	$(call say,LINK,$@)
	$(Q)mkdir -p $(@D)
	$(Q)$(CC) -shared -Wl,-z,defs -Wl,--as-needed -o $@ $^ -ldl -lpthread

ALSO_BUILT += $(shim_LIB)
