"""The container terminal simulated: plant, runs, picture, indicators, and the central planner beside it."""
