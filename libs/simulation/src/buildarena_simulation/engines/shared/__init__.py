"""Parts shared by several engines."""
