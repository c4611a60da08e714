"""``onboard operate``: what a person tells a site on its own bus (docs/operate.md).

Each command is a value: messages and time in, messages and lines for the person out. One shell around it speaks and
asks; simulated operators drive the same values.
"""
