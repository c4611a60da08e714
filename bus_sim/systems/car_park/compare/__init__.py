"""What it costs to have nobody in charge: our protocol beside central dispatchers, a bound and an optimum (row P56)."""
