"""The factory graph as it is: bodies on edges, the counter, the oracle; pictures and indicators of a run."""
