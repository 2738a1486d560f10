"""BuildArena's tasks as an environment of verifiers."""
