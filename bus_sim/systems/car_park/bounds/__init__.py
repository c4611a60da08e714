"""What no fleet can beat: two bounds of the waiting in one run of the plant, each with its proof."""
