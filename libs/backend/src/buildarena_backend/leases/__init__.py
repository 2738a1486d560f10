"""Who may work on a job, for how long, and what becomes of leases that are lost."""
