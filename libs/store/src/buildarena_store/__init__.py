"""What BuildArena keeps: tables, repositories and artifacts."""
