"""Multi-agent pick-up and delivery: robots on a grid, one cell each, all moving in unit steps."""
