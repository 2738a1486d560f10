"""Who may do what and spend how much: API keys, budgets, reservations."""
