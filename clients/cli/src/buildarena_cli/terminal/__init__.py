"""Terminal output: tables, boards and progress."""
