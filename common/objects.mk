# What both halves share. The core: no operating system, no heap, no floating point.
common_FLAGS := $(core_flags)
common_SRC := \
  common/target/layout.c \
  common/target/layout_table.c \
  common/target/target.c \
  common/fx/root.c \
  common/fx/smallsolve.c \
  common/fx/turn.c \
    common/wire/codes.c \
    common/wire/crc32c.c \
    common/wire/packet_header.c \
    common/wire/wire.c \

$(eval $(call library,common))

# The target file's reader: heap and cJSON, at start only; one set of rules for both halves.
targetfile_SRC := \
  common/targetfile/targetfile.c \

$(eval $(call library,targetfile))
