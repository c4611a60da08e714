"""Protocols of others, to measure ours against on the same bus."""
