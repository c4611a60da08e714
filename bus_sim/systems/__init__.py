"""What the simulator adds for each system: its plant, picture and demand."""
