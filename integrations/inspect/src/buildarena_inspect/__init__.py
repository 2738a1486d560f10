"""BuildArena's tasks in Inspect."""
