"""The simulation worker: runs simulators and scores rollouts."""
