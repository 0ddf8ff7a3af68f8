# 64-bit ARM: toolchain, Debian's name for it, emulator.
cross_prefix := aarch64-linux-gnu-
cross_debian := arm64
cross_run    := qemu-aarch64
