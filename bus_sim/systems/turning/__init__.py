"""The turning cell in the simulator."""
