"""What is played before the node under test, a file for each part of docs/protocol.md."""
