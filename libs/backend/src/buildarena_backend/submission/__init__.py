"""From specs to jobs in the database, and what they will cost."""
