"""The manufacturing cell in the simulator."""
