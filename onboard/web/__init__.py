"""One page that shows a site as its bus tells it: live, simulated or recorded. The extra ``web`` is needed."""
