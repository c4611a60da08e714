"""Attacks by a node that sees only the bus: what it says, and what came of it."""
