"""Seals: proof of who said a frame of the fleet bus. No I/O: time, chance and the contract are arguments."""
