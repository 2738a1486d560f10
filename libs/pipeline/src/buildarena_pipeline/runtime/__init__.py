"""What every process runs on: settings, context, stages, leases, the reaper."""
