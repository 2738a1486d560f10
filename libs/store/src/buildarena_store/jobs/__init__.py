"""Jobs with their leases, journals, rollouts, results and attempts."""
