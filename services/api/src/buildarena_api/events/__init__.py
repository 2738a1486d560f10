"""Events from the database to listeners."""
