"""BuildArena's tasks as an OpenEnv server and client."""
