"""On-board controllers for fleets of machines that run a site together with nobody in charge, over a CAN bus."""

__version__ = "0.2.0"
