"""Makes the keys of a site at its commissioning; nothing of it runs on a board."""
