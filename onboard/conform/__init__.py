"""The kit of conformity: it plays a fleet's part against one node, and judges its duties (docs/conform.md)."""
