"""A process of the service: its context, how it takes and holds jobs, the reaper of lost ones."""
