"""What the page draws of each system, folded from its messages; one file a system, chosen in ``scenes``."""
