"""Faults of a whole site as data: one table of kinds, one line for each fault, and what each does to a simulation."""
