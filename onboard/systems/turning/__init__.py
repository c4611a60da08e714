"""A cell of NC lathes: what a turned part costs on each, and the ISO program that makes it (Pujo et al. 2006, 2.3)."""
