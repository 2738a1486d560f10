"""Machine documents: machines as JSON, written, read and logged."""
