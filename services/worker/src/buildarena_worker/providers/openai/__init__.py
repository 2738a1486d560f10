"""OpenAI's chat completions: the wire that most providers speak."""
