"""BuildArena's tasks as environments of Gymnasium."""
