"""The action space: pure functions from a state and arguments to the change they propose."""
