"""Records of sessions: journal, turns, external calls, rollouts, and their texts."""
