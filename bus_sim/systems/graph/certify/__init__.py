"""Whether robots on a graph can ever stick: all interleavings of the node agents' rules (rows G29, G30)."""
