# tessera-target: makes target files and draws them.
tessera-target_FLAGS := $(call system_cflags,cairo libpng)
tessera-target_SRC := \
    tools/target/main_target.cc \
    tools/target/target_choice.cc \
    tools/target/target_drawing.cc \
    tools/target/target_json.cc \
    tools/target/target_save.cc \
    tools/target/target_sheets.cc
tessera-target_LIBS := targetfile common
tessera-target_LDLIBS := -lcairo -lpng -lcjson -lfmt

$(eval $(call program,tessera-target))
