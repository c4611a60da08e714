"""Campaigns: many seeded runs of a site under faults, what came of each, and the fewest faults that still fail."""
