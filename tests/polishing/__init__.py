"""The toy system of tests/plugin: what tests of every system must know of it."""
