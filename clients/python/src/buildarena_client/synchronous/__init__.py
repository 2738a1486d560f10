"""The client on the standard library, which waits for each answer."""
