"""A Linux guest in QEMU with a real CAN stack, for hosts whose kernel has none."""
