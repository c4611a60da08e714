"""Pick-up and delivery on a grid: the same decisions without a bus, the plant and the picture."""
