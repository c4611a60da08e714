"""One fold of the fleet bus: calls and tasks as everybody was told of them. Trace, page and gateway are its views."""
