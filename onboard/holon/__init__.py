"""One machine put together of the core's parts: who takes part, how it is held, and how it begins again."""
