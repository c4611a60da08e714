"""The car park: what tests of every system must know of it."""
