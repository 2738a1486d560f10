"""What happened in a session: journal, turns, calls to providers, rollouts, and texts of them."""
