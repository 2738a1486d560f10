"""A construction session: messages, dialogue, host, transcript."""
