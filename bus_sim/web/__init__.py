"""The page of a simulated run: its sources, system by system, and serving it beside the run."""
