"""What a person at a terminal sees: tables, boards, progress, and what the shell completes."""
