"""Building tasks as environments: steps, rewards, snapshots and trials over processes."""
