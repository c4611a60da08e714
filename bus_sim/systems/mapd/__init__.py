"""Pick-up and delivery: the robots' own decisions step by step, without a bus, and how a run of that is shown."""
