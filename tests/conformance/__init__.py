"""What every system keeps to, tried on each: those that ship and the one of tests/plugin.

A system's folder under tests has ``case.py`` with its ``CASE`` (``tests.conformance.case.Case``).
"""
