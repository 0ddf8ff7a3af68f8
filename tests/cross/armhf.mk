# 32-bit ARM (ARMv7-A, hard float): toolchain, Debian's name for it, emulator.
cross_prefix := arm-linux-gnueabihf-
cross_debian := armhf
cross_run    := qemu-arm
