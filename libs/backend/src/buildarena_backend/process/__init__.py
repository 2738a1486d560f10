"""A process of the service: its context, its jobs and leases, and the reaper of lost ones."""
