"""Judging a log: rules that see frames and the site file only and share no code with the machines they judge."""
