"""Planted bugs: switched on by name for one run, to show that the judges find them. Never in the normal path."""
