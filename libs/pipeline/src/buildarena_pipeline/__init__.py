"""The road of a job: states, leases, queues, and the embedded servers."""
