"""Design under a limit: little mass, a faulty machine, a world with hidden parameters."""
