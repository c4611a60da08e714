"""A CAN bus in virtual time: bits, arbitration, error handling, nodes and faults. Classic CAN 2.0 frames only."""
