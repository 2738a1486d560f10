"""Design under a limit: little mass, a faulty machine, a world that is not told."""
